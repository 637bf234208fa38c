// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "sightline/image/planes.hpp"

namespace sightline::observe {

using OrbDescriptor = std::array<uint8_t, 32>;

constexpr int kOrbPatch = 31;  ///< [px] of the finest level

struct OrbFeature {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double angle = 0;  ///< of its orientation [rad], x to y
  double scale = 1;  ///< size of its patch in `kOrbPatch` pixels
  float strength = 0;
  OrbDescriptor descriptor{};
};

/// ORB features of the rectangle (grown by what descriptors need) in which `mask` holds (null:
/// everywhere), strongest first. Images of up to a megapixel are searched at twice their size.
/// OpenCV; its exceptions are caught: then there are none.
std::vector<OrbFeature> orb_features(const PlaneView& gray, int x0, int y0, int x1, int y1, int max,
                                     const std::function<bool(int, int)>& mask);

}  // namespace sightline::observe
