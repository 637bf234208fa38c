// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sightline/geometry/camera_model.hpp"

namespace sightline::calibrate {

/// A point of the room, and where an image has it.
struct ScenePair {
  Eigen::Vector3d ray = Eigen::Vector3d::Zero();    ///< of the calibrated camera, unit
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< full-size image
};

/// calibrated_from_now of a camera that turned on the spot: a ray r is at project(exp(-turn) r),
/// from the principal point `zoom` times as far.
struct TurnFit {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  double zoom = 1;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double sigma_px = 0;
  int inliers = 0;
  std::vector<char> is_inlier{};  ///< by pair
};

/// The turn (and zoom, if `with_zoom`) that most pairs agree on; of equally many, none or `guess`.
/// Robust to half of them. Empty: too few agree to say so.
std::optional<TurnFit> fit_turn(const CameraModel& lens, std::span<const ScenePair> pairs,
                                const Eigen::Vector3d& guess, bool with_zoom);

}  // namespace sightline::calibrate
