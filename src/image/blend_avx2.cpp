// SPDX-License-Identifier: Apache-2.0
#include <immintrin.h>

#include <array>

#include "image/blend_kernels.hpp"

namespace sightline::image::blend {
namespace {

__m256i load(const uint8_t* p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)); }
void store(uint8_t* p, __m256i v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), v); }

// attenuate() on sixteen 16-bit lanes; `keep` holds 255 - alpha.
__m256i attenuate16(__m256i in, __m256i keep) {
  const __m256i t = _mm256_add_epi16(_mm256_mullo_epi16(in, keep), _mm256_set1_epi16(128));
  return _mm256_srli_epi16(_mm256_add_epi16(t, _mm256_srli_epi16(t, 8)), 8);
}

// over() on 32 bytes. Unpack and pack both work within 128-bit halves, so the order is kept.
__m256i over32(__m256i in, __m256i color, __m256i alpha) {
  const __m256i zero = _mm256_setzero_si256();
  const __m256i keep = _mm256_xor_si256(alpha, _mm256_set1_epi8(-1));
  const __m256i low = attenuate16(_mm256_unpacklo_epi8(in, zero), _mm256_unpacklo_epi8(keep, zero));
  const __m256i high =
      attenuate16(_mm256_unpackhi_epi8(in, zero), _mm256_unpackhi_epi8(keep, zero));
  return _mm256_adds_epu8(_mm256_packus_epi16(low, high), color);
}

// Most of a tile is empty: such stretches leave the frame's memory alone.
bool empty(__m256i color, __m256i alpha) {
  const __m256i both = _mm256_or_si256(color, alpha);
  return _mm256_testz_si256(both, both) != 0;
}

// (a0 b0 a1 b1 ...) of 16 bytes each.
__m256i interleave(const uint8_t* a, const uint8_t* b) {
  const __m128i va = _mm_loadu_si128(reinterpret_cast<const __m128i*>(a));
  const __m128i vb = _mm_loadu_si128(reinterpret_cast<const __m128i*>(b));
  return _mm256_set_m128i(_mm_unpackhi_epi8(va, vb), _mm_unpacklo_epi8(va, vb));
}

/// 255 in the last `count` of 32 bytes.
__m256i last_bytes(int count) {
  alignas(32) static constexpr std::array<uint8_t, 64> kEdge = [] {
    std::array<uint8_t, 64> edge{};
    for (size_t i = 32; i < edge.size(); ++i) edge[i] = 255;
    return edge;
  }();
  return load(kEdge.data() + count);
}

}  // namespace

void plane_row_avx2(uint8_t* frame, const uint8_t* color, const uint8_t* alpha, int n) {
  int i = 0;
  for (; i + 32 <= n; i += 32) {
    const __m256i c = load(color + i), a = load(alpha + i);
    if (empty(c, a)) continue;
    store(frame + i, over32(load(frame + i), c, a));
  }
  if (i == n) return;
  if (n < 32) {
    plane_row_scalar(frame, color, alpha, n);
    return;
  }
  // The last 32 once more: transparent where they are done.
  const __m256i open = last_bytes(n - i);
  const int last = n - 32;
  const __m256i c = _mm256_and_si256(load(color + last), open);
  const __m256i a = _mm256_and_si256(load(alpha + last), open);
  if (!empty(c, a)) store(frame + last, over32(load(frame + last), c, a));
}

void pair_row_avx2(uint8_t* frame_uv, const uint8_t* u, const uint8_t* v, const uint8_t* alpha,
                   int n) {
  int i = 0;
  for (; i + 16 <= n; i += 16) {
    const __m256i c = interleave(u + i, v + i), a = interleave(alpha + i, alpha + i);
    if (empty(c, a)) continue;
    store(frame_uv + 2 * i, over32(load(frame_uv + 2 * i), c, a));
  }
  if (i == n) return;
  if (n < 16) {
    pair_row_scalar(frame_uv, u, v, alpha, n);
    return;
  }
  const __m256i open = last_bytes(2 * (n - i));
  const int last = n - 16;
  const __m256i c = _mm256_and_si256(interleave(u + last, v + last), open);
  const __m256i a = _mm256_and_si256(interleave(alpha + last, alpha + last), open);
  if (empty(c, a)) return;
  store(frame_uv + 2 * last, over32(load(frame_uv + 2 * last), c, a));
}

}  // namespace sightline::image::blend
