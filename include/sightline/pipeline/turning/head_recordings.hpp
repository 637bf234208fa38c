// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/head_sights.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/calibration_target.hpp"

namespace sightline {

struct HeadRecordingsOptions {
  std::string camera;  ///< the one on the head
  int window = 0;      ///< see TargetDetectorOptions
  size_t every = 1;    ///< look at every so many images of a camera
  std::function<void(size_t done, size_t total)> on_progress = {};
};

/// Looks for targets (the first and its others) in every image that the camera on a head has in
/// these recordings, and in those of the cameras of `calibration` that stand still; the angles of
/// the head beside them. A target has a body for each recording; a fixed one has one for all, and
/// those whose places in the world are known are one body together.
/// Refused: what open_recording() refuses, a recording without the camera or without its angles
/// (axes.csv), a target that is found nowhere by the head (with what was found instead).
Result<HeadSights> sights_of_head(const std::vector<std::filesystem::path>& recordings,
                                  const CalibrationTarget& target,
                                  const std::vector<CalibratedCamera>& calibration,
                                  const HeadRecordingsOptions& options);

}  // namespace sightline
