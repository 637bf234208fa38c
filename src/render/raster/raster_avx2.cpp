// SPDX-License-Identifier: Apache-2.0
#include "render/raster/raster_kernels.hpp"

#ifdef __AVX2__

#include <immintrin.h>

namespace sightline::raster {
namespace {

using F8 = __m256;
struct M8 {
  __m256 v;
};

inline F8 load(const float* p) { return _mm256_loadu_ps(p); }
/// Four from each.
inline F8 load_halves(const float* p, const float* q) {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(p)), _mm_loadu_ps(q), 1);
}
inline F8 set1(float a) { return _mm256_set1_ps(a); }
inline F8 add(F8 a, F8 b) { return _mm256_add_ps(a, b); }
inline F8 sub(F8 a, F8 b) { return _mm256_sub_ps(a, b); }
inline F8 mul(F8 a, F8 b) { return _mm256_mul_ps(a, b); }
inline F8 min(F8 a, F8 b) { return _mm256_min_ps(a, b); }
inline F8 max(F8 a, F8 b) { return _mm256_max_ps(a, b); }
inline M8 greater(F8 a, F8 b) { return {_mm256_cmp_ps(a, b, _CMP_GT_OQ)}; }
inline M8 both(M8 a, M8 b) { return {_mm256_and_ps(a.v, b.v)}; }
inline unsigned bits(M8 a) { return static_cast<unsigned>(_mm256_movemask_ps(a.v)); }
inline M8 from_bits(unsigned b) {
  const __m256i lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  const __m256i set = _mm256_and_si256(_mm256_set1_epi32(static_cast<int>(b)), lane);
  return {_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lane))};
}
inline F8 select(M8 m, F8 a, F8 b) { return _mm256_blendv_ps(b, a, m.v); }
inline void store(float* p, F8 a) { _mm256_storeu_ps(p, a); }
inline void store_halves(float* p, float* q, F8 a) {
  _mm_storeu_ps(p, _mm256_castps256_ps128(a));
  _mm_storeu_ps(q, _mm256_extractf128_ps(a, 1));
}
/// The whole part of each lane.
inline void store_whole(int* p, F8 a) {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), _mm256_cvttps_epi32(a));
}
inline __m128i byte_mask(M8 m) {
  const __m256i wide = _mm256_castps_si256(m.v);
  const __m128i words =
      _mm_packs_epi32(_mm256_castsi256_si128(wide), _mm256_extracti128_si256(wide, 1));
  return _mm_packs_epi16(words, words);
}
inline void store_bytes(uint8_t* p, M8 m, uint8_t value) {
  __m128i* const at = reinterpret_cast<__m128i*>(p);
  const __m128i fresh = _mm_set1_epi8(static_cast<char>(value));
  _mm_storel_epi64(at, _mm_blendv_epi8(_mm_loadl_epi64(at), fresh, byte_mask(m)));
}
inline void store_byte_halves(uint8_t* p, uint8_t* q, M8 m, uint8_t value) {
  int low, high;
  __builtin_memcpy(&low, p, sizeof(low));
  __builtin_memcpy(&high, q, sizeof(high));
  const __m128i old = _mm_insert_epi32(_mm_cvtsi32_si128(low), high, 1);
  const __m128i fresh = _mm_set1_epi8(static_cast<char>(value));
  const __m128i both_rows = _mm_blendv_epi8(old, fresh, byte_mask(m));
  low = _mm_cvtsi128_si32(both_rows);
  high = _mm_extract_epi32(both_rows, 1);
  __builtin_memcpy(p, &low, sizeof(low));
  __builtin_memcpy(q, &high, sizeof(high));
}

inline void store_words(uint32_t* p, M8 m, uint32_t value) {
  __m256i* const at = reinterpret_cast<__m256i*>(p);
  const __m256i fresh = _mm256_set1_epi32(static_cast<int>(value));
  _mm256_storeu_si256(at,
                      _mm256_blendv_epi8(_mm256_loadu_si256(at), fresh, _mm256_castps_si256(m.v)));
}
inline void store_word_halves(uint32_t* p, uint32_t* q, M8 m, uint32_t value) {
  const __m256i mask = _mm256_castps_si256(m.v);
  const __m128i fresh = _mm_set1_epi32(static_cast<int>(value));
  __m128i* const low = reinterpret_cast<__m128i*>(p);
  __m128i* const high = reinterpret_cast<__m128i*>(q);
  _mm_storeu_si128(low, _mm_blendv_epi8(_mm_loadu_si128(low), fresh, _mm256_castsi256_si128(mask)));
  _mm_storeu_si128(
      high, _mm_blendv_epi8(_mm_loadu_si128(high), fresh, _mm256_extracti128_si256(mask, 1)));
}

}  // namespace
}  // namespace sightline::raster

#include "render/raster/raster_loops.inl"

namespace sightline::raster {

const Kernels* avx2_kernels() { return &kKernels; }

}  // namespace sightline::raster

#else

namespace sightline::raster {

const Kernels* avx2_kernels() { return nullptr; }

}  // namespace sightline::raster

#endif
