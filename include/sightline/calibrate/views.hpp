// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/calibration_target.hpp"

namespace sightline {

/// A corner of the target, found in an image.
struct TargetCorner {
  int id = 0;                                           ///< CalibrationTarget::corner()
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();      ///< [px]
  Eigen::Vector2d px_per_s = Eigen::Vector2d::Zero();   ///< how it moves; 0: unknown or still
  Eigen::Vector2d px_per_s2 = Eigen::Vector2d::Zero();  ///< and how that changes
};

/// What one camera sees of the target in one set of images taken together.
struct TargetView {
  size_t camera = 0;   ///< index in CalibrationViews::cameras
  size_t set = 0;      ///< index of the set
  double delay_s = 0;  ///< its capture time less that of the set
  std::vector<TargetCorner> corners;
  std::string source;  ///< file or time, for messages
};

struct ViewedCamera {
  std::string name;
  int width = 0, height = 0;  ///< [px]
  size_t images = 0;          ///< that were looked at

  bool operator==(const ViewedCamera&) const = default;
};

/// All that a calibration is computed from: corners of one target in sets of images. In a set the
/// target stands at one place, up to `delay_s` and the corners' own motion.
struct CalibrationViews {
  CalibrationTarget target;
  std::vector<ViewedCamera> cameras;
  size_t sets = 0;
  std::vector<TargetView> views;  ///< at most one per camera and set
};

/// Kept beside a calibration so that it can be solved again (`corners.csv`): the target and the
/// cameras as comments, then one row per corner: set,camera,delay_s,corner,u,v,du,dv,ddu,ddv (the
/// last two may be missing). Reading it back gives the same numbers.
std::string format_views(const CalibrationViews& views);
Result<CalibrationViews> parse_views(std::string_view text, const std::string& where);

/// Refuses by name what no solver can use: numbers that are not finite, corners outside the image
/// of their camera or unknown to the target, two views of a camera in a set, mirrored views (the
/// corners run the other way round), cameras without an image size.
Status check_views(const CalibrationViews& views);

/// Groups of cameras that are linked: the target was seen by two of them in one set (at least
/// `min_corners` corners each), directly or through others. By camera, the smallest index of its
/// group.
std::vector<size_t> linked_groups(const CalibrationViews& views, size_t min_corners = 6);

}  // namespace sightline
