// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace sightline::image::blend {

/// in * (255 - alpha) / 255, rounded to nearest; exact for all 8-bit values and within 16 bits.
constexpr uint8_t attenuate(uint8_t in, uint8_t alpha) {
  const auto t = static_cast<uint32_t>(in) * (255u - alpha) + 128u;
  return static_cast<uint8_t>((t + (t >> 8)) >> 8);
}

/// One blended byte; saturates where a color is not premultiplied as it should be.
constexpr uint8_t over(uint8_t in, uint8_t color, uint8_t alpha) {
  const unsigned sum = static_cast<unsigned>(color) + attenuate(in, alpha);
  return static_cast<uint8_t>(sum > 255u ? 255u : sum);
}

/// One row of a plane: `n` bytes of frame, color and alpha.
using PlaneRow = void (*)(uint8_t* frame, const uint8_t* color, const uint8_t* alpha, int n);
/// One row of interleaved chroma: `n` pairs.
using PairRow = void (*)(uint8_t* frame_uv, const uint8_t* u, const uint8_t* v,
                         const uint8_t* alpha, int n);

struct Kernels {
  PlaneRow plane;
  PairRow pair;
};

void plane_row_scalar(uint8_t* frame, const uint8_t* color, const uint8_t* alpha, int n);
void pair_row_scalar(uint8_t* frame_uv, const uint8_t* u, const uint8_t* v, const uint8_t* alpha,
                     int n);

constexpr Kernels kScalar{&plane_row_scalar, &pair_row_scalar};
/// The same to the bit by the vectors that each processor of the target has.
void plane_row_vector(uint8_t* frame, const uint8_t* color, const uint8_t* alpha, int n);
void pair_row_vector(uint8_t* frame_uv, const uint8_t* u, const uint8_t* v, const uint8_t* alpha,
                     int n);
constexpr Kernels kVector{&plane_row_vector, &pair_row_vector};
#ifdef SIGHTLINE_X86_64
/// The same to the bit; only on processors that have AVX2.
void plane_row_avx2(uint8_t* frame, const uint8_t* color, const uint8_t* alpha, int n);
void pair_row_avx2(uint8_t* frame_uv, const uint8_t* u, const uint8_t* v, const uint8_t* alpha,
                   int n);
constexpr Kernels kAvx2{&plane_row_avx2, &pair_row_avx2};
#endif

}  // namespace sightline::image::blend
