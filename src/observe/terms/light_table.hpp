// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

namespace sightline::observe {

/// Light by luma level (limited range, 16 .. 235) of a camera whose response has this exponent. An
/// edge lies where the *light* is halfway between its two sides; levels are a power of it, so that
/// in levels bright areas seem to grow by a good quarter of a pixel.
class LightTable {
 public:
  /// `white`: the light of level 235, which sets the unit of everything read from the table.
  LightTable(double gamma, double white);

  /// The white with which one level in the middle of the range is one unit of light, so that
  /// thresholds keep the meaning of gray levels.
  static double white_for_unit_slope(double gamma);

  float operator[](uint8_t level) const { return values_[level]; }

 private:
  std::array<float, 256> values_;
};

}  // namespace sightline::observe
