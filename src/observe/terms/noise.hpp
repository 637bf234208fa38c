// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// Standard deviation of an image's noise [levels], by how far pixels are from what their neighbors
/// say (Immerkaer, "Fast noise variance estimation", CVIU 64, 1996), of the quarter of all pixels
/// where that is least: edges and texture do not count.
double noise_level(const PlaneView& plane);

/// How often a camera's plane has to be smoothed so that search finds edges in it rather than
/// noise. Changes only where the noise does, so that images stay comparable.
class Smoothing {
 public:
  /// 0 for less noise than every image of a compressed video has; up to kMost.
  int update(const PlaneView& plane);

  static constexpr int kMost = 6;

 private:
  int passes_ = 0;
};

/// Means of 3 x 3 pixels with binomial weights, in place. White noise becomes 0.38, 0.27, 0.23 and
/// 0.20 of itself in one to four passes; each adds half a square pixel to the variance of a blur.
class BinomialFilter {
 public:
  void smooth(const MutablePlaneView& plane, int passes);
  /// The largest central difference at a step after so many passes, over that before.
  static float sharpness(int passes);

 private:
  void pass(const MutablePlaneView& plane);

  std::vector<uint8_t> above_, here_;
  std::vector<uint16_t> sums_;
};

}  // namespace sightline::observe
