// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/geometry/rotation_between.hpp"

namespace sightline::observe {

/// An object from its sides, to compare it with itself: square pictures from so many radii away,
/// of which the bounding sphere fills 94 %.
constexpr double kSideDistance = 8;
/// Surfaces are the same up to so much of the radius.
constexpr double kSameSurface = 0.06;

inline Result<CameraModel> side_camera(int pixels) {
  CameraModel::Parameters parameters;
  parameters.width = parameters.height = pixels;
  parameters.fx = parameters.fy = 0.47 * pixels / std::tan(std::asin(1 / kSideDistance));
  parameters.cx = parameters.cy = 0.5 * (pixels - 1);
  return CameraModel::create(parameters, "near symmetry");
}

/// camera_from_object. `direction`: unit, object frame, towards the camera; `center`, `radius`: of
/// the bounding sphere.
inline Rigid3 side_pose(const Eigen::Vector3d& direction, const Eigen::Vector3d& center,
                        double radius) {
  const Eigen::Quaterniond rotation = rotation_between(-direction, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d in_front(0, 0, kSideDistance * radius);
  return Rigid3(rotation, in_front - rotation * center);
}

}  // namespace sightline::observe
