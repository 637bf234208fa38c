// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>

#include "observe/terms/camera_view.hpp"
#include "observe/terms/light_table.hpp"
#include "sightline/observe/track/object_tracker.hpp"

namespace sightline::observe {

/// What the objects of one tracker share: the camera, the scene that hides, the options. Terms keep
/// `owner` alive.
struct TrackerCamera : CameraView {
  TrackerCamera(std::shared_ptr<const CalibratedCamera> calibrated,
                const TrackerOptions& tracker_options, SceneDepth scene_depth)
      : CameraView(*calibrated),
        owner(std::move(calibrated)),
        options(tracker_options),
        scene(std::move(scene_depth)),
        light(options.gamma, LightTable::white_for_unit_slope(options.gamma)) {}

  std::shared_ptr<const CalibratedCamera> owner;
  TrackerOptions options;
  SceneDepth scene;
  LightTable light;
};

}  // namespace sightline::observe
