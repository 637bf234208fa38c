// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// One sight of a point: the pixel it was measured at and the standard deviation of that.
struct PointSight {
  const CalibratedCamera* camera = nullptr;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 0.5;
};

struct TriangulatedPoint {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();  ///< [m]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();      ///< world axes [m^2]
  double rms_px = 0;                                         ///< reprojection error
};

/// The point that minimizes the weighted squared reprojection error in two or more cameras:
/// midpoint of the rays, then Gauss-Newton through the full lens. The covariance is the inverse of
/// the normal matrix (Hartley & Zisserman, 2nd ed., section 5.2). Refused: fewer than two sights,
/// rays that are parallel, a point behind a camera.
Result<TriangulatedPoint> triangulate(std::span<const PointSight> sights);

}  // namespace sightline
