// SPDX-License-Identifier: Apache-2.0
// Bars over eight pixels at a time, compiled twice: with four floats to a vector for any processor
// and with eight for AVX2. Includes nothing of any library, so that no inline function is compiled
// for AVX2 and then shared.
#include "render/overlay/lines/bar_kernels.hpp"

namespace sightline::bars {
namespace {

constexpr int kLanes = 8;
constexpr int kWide = SIGHTLINE_BAR_LANES;
using Floats [[gnu::vector_size(4 * kWide)]] = float;
using Ints [[gnu::vector_size(4 * kWide)]] = int32_t;
using Shorts [[gnu::vector_size(2 * kLanes)]] = int16_t;
using SomeShorts [[gnu::vector_size(2 * kWide)]] = int16_t;
using Bytes [[gnu::vector_size(kLanes)]] = uint8_t;

inline float smaller(float a, float b) { return a < b ? a : b; }
inline float larger(float a, float b) { return a > b ? a : b; }

/// Rounding without a call into the mathematics library, which is what ceil is below SSE4.1.
inline int ceil_of(float value) {
  const int whole = static_cast<int>(value);
  return whole + (static_cast<float>(whole) < value ? 1 : 0);
}
inline int floor_of(float value) {
  const int whole = static_cast<int>(value);
  return whole - (static_cast<float>(whole) > value ? 1 : 0);
}

/// Integers x with low <= x <= high, within 0..limit-1.
inline int first_of(float low, int limit) {
  return ceil_of(smaller(larger(low, 0), static_cast<float>(limit)));
}
inline int last_of(float high, int limit) {
  return floor_of(smaller(larger(high, -1), static_cast<float>(limit - 1)));
}

inline Floats magnitude(Floats v) {
  return reinterpret_cast<Floats>(reinterpret_cast<Ints>(v) & 0x7fffffff);
}
inline Floats clamp(Floats v, float high) {
  const Floats zero = {};
  const Floats top = zero + high;
  const Floats cut = v < top ? v : top;
  return cut > zero ? cut : zero;
}

/// Alphas 0..128 of kWide pixels, so that products with bytes fit 16 bits. `kEnds`: an end of the
/// bar may be near; elsewhere coverage along it is 1.
template <bool kEnds>
inline SomeShorts alphas(const Bar& bar, Floats dx, float dy) {
  const Floats across = magnitude(bar.along_x * dy - bar.along_y * dx);
  Floats coverage = clamp(bar.reach_across - across, bar.max);
  if constexpr (kEnds) {
    const Floats lengthways = magnitude(bar.along_x * dx + bar.along_y * dy);
    coverage *= clamp(bar.reach_along - lengthways, 1.0f);
  }
  return __builtin_convertvector(
      __builtin_convertvector(coverage * bar.opacity * 128.0f + 0.5f, Ints), SomeShorts);
}

template <bool kEnds>
inline Shorts alphas8(const Bar& bar, float dx, float dy) {
#if SIGHTLINE_BAR_LANES == 8
  const Floats steps = {0, 1, 2, 3, 4, 5, 6, 7};
  return alphas<kEnds>(bar, dx + steps, dy);
#else
  const Floats steps = {0, 1, 2, 3};
  return __builtin_shufflevector(alphas<kEnds>(bar, dx + steps, dy),
                                 alphas<kEnds>(bar, dx + 4 + steps, dy), 0, 1, 2, 3, 4, 5, 6, 7);
#endif
}

template <int Planes>
inline void blend8(const Bar& bar, int x, int y, Shorts alpha) {
  for (int i = 0; i < Planes; ++i) {
    uint8_t* at = bar.plane[i] + y * bar.stride[i] + x;
    Bytes bytes;
    __builtin_memcpy(&bytes, at, sizeof(bytes));
    const Shorts old = __builtin_convertvector(bytes, Shorts);
    const Shorts change = ((static_cast<int16_t>(bar.value[i]) - old) * alpha + 64) >> 7;
    bytes = __builtin_convertvector(old + change, Bytes);
    __builtin_memcpy(at, &bytes, sizeof(bytes));
  }
}

/// The first `count` of eight pixels, wherever they lie in memory.
template <int Planes>
inline void blend_some(const Bar& bar, int x, int y, Shorts alpha, int count) {
  for (int i = 0; i < Planes; ++i) {
    for (int k = 0; k < count; ++k) {
      uint8_t& byte = bar.plane[i][y * bar.stride[i] + (x + k) * bar.step];
      byte = static_cast<uint8_t>(byte + (((bar.value[i] - byte) * alpha[k] + 64) >> 7));
    }
  }
}

/// The dx for which |slope * dx + offset| <= reach, offset growing with dy: a band around a line.
struct Band {
  float drift;  ///< of its middle per dy
  float half;   ///< half its width; 0: the slope is (almost) none
  float offset, reach;
  Band(float slope, float offset_per_dy, float band_reach)
      : drift(0), half(0), offset(offset_per_dy), reach(band_reach) {
    if (slope < 1e-6f && slope > -1e-6f) return;
    drift = -offset_per_dy / slope;
    half = band_reach / (slope < 0 ? -slope : slope);
  }
  void cut(float dy, float& low, float& high) const {
    if (half == 0) {
      const float off = offset * dy;
      if (off > reach || off < -reach) high = low - 1;
      return;
    }
    low = larger(low, drift * dy - half);
    high = smaller(high, drift * dy + half);
  }
};

/// The pixels of a row from low to high, counted from the bar's middle. Lanes beyond the bar have
/// alpha 0 and keep their pixels.
template <int Planes, bool kEnds>
inline void draw_row(const Bar& bar, int y, float dy, float low, float high) {
  const int last = last_of(high + bar.middle_x, bar.width);
  for (int x = first_of(low + bar.middle_x, bar.width); x <= last; x += kLanes) {
    const Shorts alpha = alphas8<kEnds>(bar, static_cast<float>(x) - bar.middle_x, dy);
    if (bar.step == 1 && x + kLanes <= bar.width) {
      blend8<Planes>(bar, x, y, alpha);
    } else {
      blend_some<Planes>(bar, x, y, alpha, bar.width - x < kLanes ? bar.width - x : kLanes);
    }
  }
}

template <int Planes>
void draw(const Bar& given) {
  const Bar bar = given;  // here, where no byte that is written can change it
  const Band across(-bar.along_y, bar.along_x, bar.reach_across);
  const Band lengthways(bar.along_x, bar.along_y, bar.reach_along);
  const float extent = (bar.along_y < 0 ? -bar.along_y : bar.along_y) * bar.reach_along +
                       (bar.along_x < 0 ? -bar.along_x : bar.along_x) * bar.reach_across;
  // Where both ends of a row are nearer than this to the middle, coverage along the bar is 1; the
  // pixel of slack is for lanes that round beyond the row's ends.
  const float far_from_ends = bar.reach_along - 2;
  const int last_row = last_of(bar.middle_y + extent, bar.height);
  for (int y = first_of(bar.middle_y - extent, bar.height); y <= last_row; ++y) {
    const float dy = static_cast<float>(y) - bar.middle_y;
    float low = -1e9f;
    float high = 1e9f;
    across.cut(dy, low, high);
    const float at_low = bar.along_x * low + bar.along_y * dy;
    const float at_high = bar.along_x * high + bar.along_y * dy;
    if (larger(at_low, at_high) <= far_from_ends && smaller(at_low, at_high) >= -far_from_ends &&
        low <= high) {
      draw_row<Planes, false>(bar, y, dy, low, high);
      continue;
    }
    lengthways.cut(dy, low, high);
    if (low <= high) draw_row<Planes, true>(bar, y, dy, low, high);
  }
}

}  // namespace

void SIGHTLINE_BAR_DRAW(const Bar& bar) {
  if (bar.planes == 1) {
    draw<1>(bar);
  } else {
    draw<2>(bar);
  }
}

}  // namespace sightline::bars
