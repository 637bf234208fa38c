// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/mesh/color.hpp"

#include <algorithm>
#include <cmath>

namespace sightline {

Yuv to_yuv(Rgb color) {
  const double r = color.r / 255.0;
  const double g = color.g / 255.0;
  const double b = color.b / 255.0;
  const double luma = 0.299 * r + 0.587 * g + 0.114 * b;
  const auto byte = [](double value) {
    return static_cast<uint8_t>(std::clamp(std::lround(value), 0L, 255L));
  };
  return {byte(16 + 219 * luma), byte(128 + 224 * (b - luma) / 1.772),
          byte(128 + 224 * (r - luma) / 1.402)};
}

}  // namespace sightline
