// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace sightline {

/// A spot of an object's surface and its color.
struct SurfaceSample {
  Eigen::Vector3f point;   ///< object frame [m]
  Eigen::Vector3f normal;  ///< unit, outward
  Eigen::Vector3f color;   ///< Y'CbCr, BT.601 limited range [levels]
};
using SurfaceSamples = std::shared_ptr<const std::vector<SurfaceSample>>;

}  // namespace sightline
