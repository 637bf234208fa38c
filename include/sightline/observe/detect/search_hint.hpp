// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <variant>

#include "sightline/base/ids.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// About where the middle of an object is in the image of one camera.
struct ImageHint {
  static constexpr double kRadiusPx = 60;  ///< where nobody says how far off it may be

  CameraId camera;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double radius_px = kRadiusPx;
};

/// Where somebody says that an object is: about at this pose (world_from_object), or there in an
/// image. It says where to look first, never what is there: the images are asked as ever.
using SearchHint = std::variant<Rigid3, ImageHint>;

}  // namespace sightline
