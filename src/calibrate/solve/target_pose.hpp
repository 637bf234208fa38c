// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "calibrate/solve/bundle.hpp"

namespace sightline::calibrate {

struct TargetPose {
  Rigid3 camera_from_target;
  double rms_px = 0;
};

/// Pose of a flat target in one view through a given lens, from nothing: homography of the rays,
/// both poses of a plane that look alike, each refined. `only`: corners that take part (by corner
/// of the view; null: all). Empty with fewer than four corners or where nothing fits.
std::optional<TargetPose> target_pose(const CalibrationTarget& target, const Eigen::Vector2d& bend,
                                      LensModel lens, const LensVector& values,
                                      const TargetView& view,
                                      const std::vector<char>* only = nullptr);

/// Homography from points to points (normalized DLT; Hartley & Zisserman, 2nd ed., algorithm 4.2),
/// up to scale. Empty with fewer than four points or where they lie on a line.
std::optional<Eigen::Matrix3d> homography(const std::vector<Eigen::Vector2d>& from,
                                          const std::vector<Eigen::Vector2d>& to);

/// A start for the lens of one camera, without any knowledge: focal lengths are tried, poses fitted
/// to each, the best ones adjusted. Only the views of `views` are used. Empty if no view can be
/// explained.
std::optional<LensVector> initial_lens(const CalibrationTarget& target, LensModel lens, int width,
                                       int height, const std::vector<const TargetView*>& views);

}  // namespace sightline::calibrate
