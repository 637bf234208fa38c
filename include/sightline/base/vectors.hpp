// SPDX-License-Identifier: Apache-2.0
#pragma once

// What kernels need of a processor's vectors beyond what the compiler's own vector types express:
// 32 bytes where the including file is compiled for AVX2, else the 16 that every x86-64 (SSE2) and
// every arm64 (NEON) has. Each function gives the same bits on all of them; without any of these it
// is plain code, which works everywhere.
//
// Internal linkage, and nothing of any library but the processor's own header: an inline function
// that is compiled for AVX2 in one file could otherwise be the one that the linker takes for all.

#include <cstdint>

#if defined(__AVX2__) || defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

namespace sightline::vectors {
namespace {  // NOLINT(google-build-namespaces): see above

#ifdef __AVX2__
inline constexpr int kBytes = 32;
#else
inline constexpr int kBytes = 16;
#endif
inline constexpr int kFloats = kBytes / 4;

using Bytes [[gnu::vector_size(kBytes)]] = uint8_t;
using Shorts [[gnu::vector_size(kBytes)]] = uint16_t;
using Ints [[gnu::vector_size(kBytes)]] = int32_t;
using Floats [[gnu::vector_size(kBytes)]] = float;
using HalfBytes [[gnu::vector_size(kBytes / 2)]] = uint8_t;
using EightBytes [[gnu::vector_size(8)]] = uint8_t;
using FourInts [[gnu::vector_size(16)]] = int32_t;
using FourFloats [[gnu::vector_size(16)]] = float;

/// Unaligned.
template <typename Vector, typename Element>
inline Vector load(const Element* from) {
  Vector v;
  __builtin_memcpy(&v, from, sizeof v);
  return v;
}
template <typename Vector, typename Element>
inline void store(Element* to, Vector v) {
  __builtin_memcpy(to, &v, sizeof v);
}

/// Whether any bit is set.
inline bool any(Bytes v) {
#if defined(__AVX2__)
  const __m256i all = reinterpret_cast<__m256i>(v);
  return _mm256_testz_si256(all, all) == 0;
#elif defined(__SSE2__)
  const __m128i zeros = _mm_cmpeq_epi8(reinterpret_cast<__m128i>(v), _mm_setzero_si128());
  return _mm_movemask_epi8(zeros) != 0xffff;
#else
  const auto words = reinterpret_cast<uint64_t [[gnu::vector_size(kBytes)]]>(v);
  return (words[0] | words[1]) != 0;
#endif
}

/// Lane by lane: -1 where a > b, else 0. AVX2 compares with an operand in memory only if told the
/// order.
inline Ints greater(Floats a, Floats b) {
#if defined(__AVX2__)
  return reinterpret_cast<Ints>(_mm256_cmp_ps(a, b, _CMP_GT_OQ));
#else
  return a > b;
#endif
}

/// Lane by lane: `yes` where the mask is -1, `no` where it is 0.
inline Floats choose(Ints mask, Floats yes, Floats no) {
#if defined(__AVX2__)
  return _mm256_blendv_ps(no, yes, reinterpret_cast<__m256>(mask));
#elif defined(__ARM_NEON)
  return vbslq_f32(reinterpret_cast<uint32x4_t>(mask), yes, no);
#else
  return reinterpret_cast<Floats>((mask & reinterpret_cast<Ints>(yes)) |
                                  (~mask & reinterpret_cast<Ints>(no)));
#endif
}

/// Masks of eight lanes (0 or -1 each) to a bit each, the first lane lowest.
inline unsigned bits_of_eight(const Ints (&mask)[8 / kFloats]) {
#if defined(__AVX2__)
  return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask[0])));
#elif defined(__SSE2__)
  return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(mask[0])) |
                               _mm_movemask_ps(reinterpret_cast<__m128>(mask[1])) << 4);
#else
  const Ints bits = (mask[0] & Ints{1, 2, 4, 8}) | (mask[1] & Ints{16, 32, 64, 128});
#ifdef __ARM_NEON
  return static_cast<unsigned>(vaddvq_s32(bits));
#else
  return static_cast<unsigned>(bits[0] | bits[1] | bits[2] | bits[3]);
#endif
#endif
}

/// Eight bytes: `value` where a mask of eight lanes (0 or -1 each) is set, else as they are.
inline EightBytes with_value(const Ints (&mask)[8 / kFloats], EightBytes old, uint8_t value) {
#if defined(__AVX2__)
  const __m256i wide = reinterpret_cast<__m256i>(mask[0]);
  const __m128i shorts =
      _mm_packs_epi32(_mm256_castsi256_si128(wide), _mm256_extracti128_si256(wide, 1));
  const __m128i mixed =
      _mm_blendv_epi8(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(&old)),
                      _mm_set1_epi8(static_cast<char>(value)), _mm_packs_epi16(shorts, shorts));
  return reinterpret_cast<EightBytes>(_mm_cvtsi128_si64(mixed));
#else
#if defined(__SSE2__)
  const __m128i shorts =
      _mm_packs_epi32(reinterpret_cast<__m128i>(mask[0]), reinterpret_cast<__m128i>(mask[1]));
  const auto set = reinterpret_cast<EightBytes>(_mm_cvtsi128_si64(_mm_packs_epi16(shorts, shorts)));
#else
  const EightBytes set =
      __builtin_shufflevector(reinterpret_cast<Bytes>(mask[0]), reinterpret_cast<Bytes>(mask[1]), 0,
                              4, 8, 12, 16, 20, 24, 28);
#endif
  return old ^ ((old ^ (EightBytes{} + value)) & set);
#endif
}

/// Masks of the lanes of four vectors (0 or -1 each) to a byte each, in order.
inline Bytes bytes_of_four(const Ints (&mask)[4]) {
#if defined(__AVX2__)
  const auto wide = [&](int k) { return reinterpret_cast<__m256i>(mask[k]); };
  const __m256i mixed = _mm256_packs_epi16(_mm256_packs_epi32(wide(0), wide(1)),
                                           _mm256_packs_epi32(wide(2), wide(3)));
  return reinterpret_cast<Bytes>(
      _mm256_permutevar8x32_epi32(mixed, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7)));
#elif defined(__SSE2__)
  const auto wide = [&](int k) { return reinterpret_cast<__m128i>(mask[k]); };
  return reinterpret_cast<Bytes>(
      _mm_packs_epi16(_mm_packs_epi32(wide(0), wide(1)), _mm_packs_epi32(wide(2), wide(3))));
#else
  using Halves [[gnu::vector_size(16)]] = uint16_t;
  const auto even = [](Ints a, Ints b) {
    return __builtin_shufflevector(reinterpret_cast<Halves>(a), reinterpret_cast<Halves>(b), 0, 2,
                                   4, 6, 8, 10, 12, 14);
  };
  return __builtin_shufflevector(reinterpret_cast<Bytes>(even(mask[0], mask[1])),
                                 reinterpret_cast<Bytes>(even(mask[2], mask[3])), 0, 2, 4, 6, 8, 10,
                                 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
#endif
}

/// 32 bytes (0 or 255 each) to a bit each, the first byte lowest.
inline uint32_t bits_of_32(const Bytes (&mask)[32 / kBytes]) {
#if defined(__AVX2__)
  return static_cast<uint32_t>(_mm256_movemask_epi8(reinterpret_cast<__m256i>(mask[0])));
#elif defined(__SSE2__)
  const auto low = static_cast<uint32_t>(_mm_movemask_epi8(reinterpret_cast<__m128i>(mask[0])));
  return low | static_cast<uint32_t>(_mm_movemask_epi8(reinterpret_cast<__m128i>(mask[1]))) << 16;
#elif defined(__ARM_NEON)
  const Bytes lane = {1, 2, 4, 8, 16, 32, 64, 128, 1, 2, 4, 8, 16, 32, 64, 128};
  const uint8x16_t pairs = vpaddq_u8(mask[0] & lane, mask[1] & lane);
  const uint8x16_t fours = vpaddq_u8(pairs, pairs);
  return vgetq_lane_u32(vreinterpretq_u32_u8(vpaddq_u8(fours, fours)), 0);
#else
  uint32_t bits = 0;
  for (int k = 0; k < 32; ++k) bits |= uint32_t{mask[k / 16][k % 16] & 1u} << k;
  return bits;
#endif
}

/// Bits set in combine(a, b), word by word, of two arrays of so many 64-bit words.
template <int kWords, typename Combine>
inline int bits_set(const void* a, const void* b, Combine combine) {
  const auto* const from_a = static_cast<const uint8_t*>(a);
  const auto* const from_b = static_cast<const uint8_t*>(b);
#ifdef __ARM_NEON
  static_assert(kWords % 2 == 0 && kWords < 64, "sums in bytes");
  uint8x16_t sums = {};
  for (int i = 0; i < 8 * kWords; i += 16) {
    const auto both = combine(load<uint8x16_t>(from_a + i), load<uint8x16_t>(from_b + i));
    sums += vcntq_u8(both);
  }
  return vaddlvq_u8(sums);
#else
  int bits = 0;
  for (int i = 0; i < 8 * kWords; i += 8)
    bits += __builtin_popcountll(combine(load<uint64_t>(from_a + i), load<uint64_t>(from_b + i)));
  return bits;
#endif
}

}  // namespace
}  // namespace sightline::vectors
