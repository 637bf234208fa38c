// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "camera_unit.hpp"
#include "points_unit.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

struct CameraState {
  std::string name;
  CameraStatus status;
  std::string url;
  std::string encoder;
  int viewers = 0;
};

/// What /api/state says (docs/api.md).
std::string format_state_json(const std::string& installation, std::span<const CameraState> cameras,
                              std::span<const NamedObject> objects,
                              std::span<const PoseTrackPtr> tracks,
                              std::span<const std::string> camera_names,
                              std::span<const PointCheck> checks = {});

}  // namespace sightline
