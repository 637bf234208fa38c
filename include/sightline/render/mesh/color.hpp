// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace sightline {

/// Full-range sRGB, as people write colors.
struct Rgb {
  uint8_t r = 0, g = 0, b = 0;
  friend constexpr bool operator==(const Rgb&, const Rgb&) = default;
};

/// BT.601 limited range, as frames are.
struct Yuv {
  uint8_t y = 16, u = 128, v = 128;
  friend constexpr bool operator==(const Yuv&, const Yuv&) = default;
};

/// ITU-R BT.601-7, limited range (Y 16..235, U and V 16..240), rounded.
Yuv to_yuv(Rgb color);

}  // namespace sightline
