// SPDX-License-Identifier: Apache-2.0
#include "pipeline/calibrate/target_finder.hpp"

namespace sightline::pipeline {

Result<std::unique_ptr<TargetFinder>> TargetFinder::create(const CalibrationTarget& target,
                                                           int window, size_t cameras) {
  auto finder = std::unique_ptr<TargetFinder>(new TargetFinder(target));
  for (size_t c = 0; c < cameras; ++c) {
    SL_ASSIGN(auto detector,
              TargetDetector::create(target, TargetDetectorOptions{.window = window}));
    finder->detectors_.push_back(std::move(detector));
  }
  finder->found_.resize(cameras, 0);
  finder->unexplained_.resize(cameras);
  return finder;
}

std::vector<TargetCorner> TargetFinder::look(size_t camera, const FramePtr& frame) {
  std::vector<TargetCorner> corners;
  for (const DetectedCorner& c : detectors_[camera]->detect(*frame)) {
    corners.push_back({c.id, c.pixel, Eigen::Vector2d::Zero()});
  }
  found_[camera] += !corners.empty();
  if (corners.empty() && unexplained_[camera].size() < 6) unexplained_[camera].push_back(frame);
  return corners;
}

Status TargetFinder::finish(const std::vector<ViewedCamera>& cameras,
                            const std::vector<char>& excused) const {
  for (size_t c = 0; c < cameras.size(); ++c) {
    const CharucoLayout layout = detectors_[c]->layout();
    if (target_.layout != CharucoLayout::kAny && layout != CharucoLayout::kAny &&
        layout != target_.layout) {
      const bool dark = layout == CharucoLayout::kDarkFirst;
      return make_error(
          ErrorCode::kInvalidInput, "camera " + cameras[c].name,
          "the print has the other layout for its even number of rows: {} at its top-left. Write "
          "layout = \"{}\" (or \"any\") into the target file",
          dark ? "a dark square" : "a marker", dark ? "dark_first" : "marker_first");
    }
    if (found_[c] > 0 || excused[c]) continue;
    std::string reason;
    for (const FramePtr& frame : unexplained_[c]) {
      reason = explain_missing_target(target_, *frame);
      if (!reason.empty()) break;
    }
    return make_error(ErrorCode::kInvalidInput, "camera " + cameras[c].name,
                      "the {} is in none of its {} images{}", target_.describe(), cameras[c].images,
                      reason.empty() ? "; is it in view, large and sharp enough?" : ": " + reason);
  }
  return {};
}

}  // namespace sightline::pipeline
