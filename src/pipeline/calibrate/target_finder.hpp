// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/calibrate/views.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/fiducial/target_detector.hpp"

namespace sightline::pipeline {

/// Finds one target in the images of all cameras, and says why not.
class TargetFinder {
 public:
  /// `window`: see TargetDetectorOptions.
  static Result<std::unique_ptr<TargetFinder>> create(const CalibrationTarget& target, int window,
                                                      size_t cameras);

  bool found_any(size_t camera) const { return found_[camera] > 0; }
  std::vector<TargetCorner> look(size_t camera, const FramePtr& frame);
  /// After all images: refuses a target that a camera never showed, unless that one is excused, and
  /// the other layout.
  Status finish(const std::vector<ViewedCamera>& cameras, const std::vector<char>& excused) const;

 private:
  explicit TargetFinder(const CalibrationTarget& target) : target_(target) {}

  CalibrationTarget target_;
  std::vector<std::unique_ptr<TargetDetector>> detectors_;
  std::vector<size_t> found_;
  std::vector<std::vector<FramePtr>> unexplained_;
};

}  // namespace sightline::pipeline
