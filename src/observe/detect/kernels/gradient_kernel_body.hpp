// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "observe/detect/kernels/gradient_kernel.hpp"

namespace sightline::observe {
namespace {

// Bytes may be part of anything: without `__restrict` each would have to be read again after every
// result. The rows of the images and those of the results are different memory.
template <bool kFirst>
inline void add_plane(const GradientRows& rows, int left, int right, float* __restrict gx,
                      float* __restrict gy, float* __restrict squared) {
  const uint8_t* __restrict above = rows.above;
  const uint8_t* __restrict here = rows.here;
  const uint8_t* __restrict below = rows.below;
  const float weight = rows.weight;
  for (int x = left; x < right; ++x) {
    const int dx =
        above[x + 1] - above[x - 1] + 2 * (here[x + 1] - here[x - 1]) + below[x + 1] - below[x - 1];
    const int dy =
        below[x - 1] - above[x - 1] + 2 * (below[x] - above[x]) + below[x + 1] - above[x + 1];
    const float u = weight * static_cast<float>(dx), v = weight * static_cast<float>(dy);
    const float strength = u * u + v * v;
    const bool stronger = kFirst || strength > squared[x];
    gx[x] = stronger ? u : gx[x];
    gy[x] = stronger ? v : gy[x];
    squared[x] = stronger ? strength : squared[x];
  }
}

inline void find_in_row(const std::array<GradientRows, 3>& planes, int left, int right,
                        const GradientRow& out) {
  add_plane<true>(planes[0], left, right, out.x, out.y, out.magnitude);
  add_plane<false>(planes[1], left, right, out.x, out.y, out.magnitude);
  add_plane<false>(planes[2], left, right, out.x, out.y, out.magnitude);
  float* __restrict magnitude = out.magnitude;
  for (int x = left; x < right; ++x) magnitude[x] = std::sqrt(magnitude[x]);
}

}  // namespace
}  // namespace sightline::observe
