// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace sightline {

/// A spot of an object's surface and its colour.
struct SurfaceSpot {
  Eigen::Vector3f point;   ///< object frame [m]
  Eigen::Vector3f normal;  ///< unit, outward
  Eigen::Vector3f color;   ///< Y'CbCr, BT.601 limited range [levels]
};
using SurfaceSpots = std::shared_ptr<const std::vector<SurfaceSpot>>;

}  // namespace sightline
