// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/kernels/response_kernel.hpp"

#include "sightline/base/cpu.hpp"

namespace sightline::observe {

int sum_responses_scalar(const ResponsePlanes& maps, const PlacedFeatures& features, float x,
                         float y, float scale) {
  const auto width = static_cast<float>(maps.width), height = static_cast<float>(maps.height);
  int sum = 0;
  for (size_t i = 0; i < features.count; ++i) {
    const float u = x + scale * features.x[i], v = y + scale * features.y[i];
    if (!(u >= 0 && v >= 0 && u < width && v < height)) continue;
    const int column = static_cast<int>(u) + maps.margin, row = static_cast<int>(v) + maps.margin;
    sum += maps.bytes[features.bins[i] * maps.plane + row * maps.stride + column / 2 +
                      column % 2 * maps.half];
  }
  return sum;
}

int sum_responses(const ResponsePlanes& maps, const PlacedFeatures& features, float x, float y,
                  float scale) {
#ifdef SIGHTLINE_X86_64
  static const auto best = cpu_has_avx2() ? sum_responses_avx2 : sum_responses_scalar;
  return best(maps, features, x, y, scale);
#else
  return sum_responses_scalar(maps, features, x, y, scale);
#endif
}

}  // namespace sightline::observe
