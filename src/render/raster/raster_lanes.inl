// SPDX-License-Identifier: Apache-2.0
// The eight lanes F8/M8 of raster_loops.inl in vectors: two of four floats for any processor of the target, one of
// eight for AVX2. Internal linkage; see raster_kernels.hpp.
#include "render/raster/raster_kernels.hpp"
#include "sightline/base/vectors.hpp"

namespace sightline::raster {
namespace {

using vectors::EightBytes;
using vectors::Floats;
using vectors::FourFloats;
using vectors::FourInts;
using vectors::Ints;
using vectors::kFloats;

constexpr int kParts = 8 / kFloats;
struct F8 {
  Floats part[kParts];
};
struct M8 {
  Ints part[kParts];  ///< lanes 0 or -1
};

#ifdef __AVX2__
inline F8 joined(FourFloats low, FourFloats high) { return {{_mm256_set_m128(high, low)}}; }
inline FourFloats first_four(F8 a) { return _mm256_castps256_ps128(a.part[0]); }
inline FourFloats last_four(F8 a) { return _mm256_extractf128_ps(a.part[0], 1); }
inline FourInts first_four(M8 m) {
  return reinterpret_cast<FourInts>(_mm256_castps256_ps128(reinterpret_cast<Floats>(m.part[0])));
}
inline FourInts last_four(M8 m) {
  return reinterpret_cast<FourInts>(_mm256_extractf128_ps(reinterpret_cast<Floats>(m.part[0]), 1));
}
#else
inline F8 joined(FourFloats low, FourFloats high) { return {{low, high}}; }
inline FourFloats first_four(F8 a) { return a.part[0]; }
inline FourFloats last_four(F8 a) { return a.part[1]; }
inline FourInts first_four(M8 m) { return m.part[0]; }
inline FourInts last_four(M8 m) { return m.part[1]; }
#endif

template <typename Make>
inline F8 each(Make make) {
  F8 out;
  for (int k = 0; k < kParts; ++k) out.part[k] = make(k);
  return out;
}
inline F8 load(const float* p) {
  return each([p](int k) { return vectors::load<Floats>(p + k * kFloats); });
}
/// Four from each.
inline F8 load_halves(const float* p, const float* q) {
  return joined(vectors::load<FourFloats>(p), vectors::load<FourFloats>(q));
}
inline F8 set1(float a) {
  return each([a](int) { return a - Floats{}; });  // the minus keeps -0
}
inline F8 add(F8 a, F8 b) {
  return each([&](int k) { return a.part[k] + b.part[k]; });
}
inline F8 sub(F8 a, F8 b) {
  return each([&](int k) { return a.part[k] - b.part[k]; });
}
inline F8 mul(F8 a, F8 b) {
  return each([&](int k) { return a.part[k] * b.part[k]; });
}
inline F8 min(F8 a, F8 b) {
  return each([&](int k) { return a.part[k] < b.part[k] ? a.part[k] : b.part[k]; });
}
inline F8 max(F8 a, F8 b) {
  return each([&](int k) { return a.part[k] > b.part[k] ? a.part[k] : b.part[k]; });
}
inline M8 greater(F8 a, F8 b) {
  M8 out;
  for (int k = 0; k < kParts; ++k) out.part[k] = vectors::greater(a.part[k], b.part[k]);
  return out;
}
inline M8 both(M8 a, M8 b) {
  M8 out;
  for (int k = 0; k < kParts; ++k) out.part[k] = a.part[k] & b.part[k];
  return out;
}
inline unsigned bits(M8 a) { return vectors::bits_of_eight(a.part); }
inline M8 from_bits(unsigned b) {
  M8 out;
  for (int k = 0; k < kParts; ++k) {
    Ints lane;
    for (int i = 0; i < kFloats; ++i) lane[i] = 1 << (k * kFloats + i);
    out.part[k] = (static_cast<int>(b) & lane) == lane;
  }
  return out;
}
inline F8 select(M8 m, F8 a, F8 b) {
  return each([&](int k) { return vectors::choose(m.part[k], a.part[k], b.part[k]); });
}
inline void store(float* p, F8 a) {
  for (int k = 0; k < kParts; ++k) vectors::store(p + k * kFloats, a.part[k]);
}
inline void store_halves(float* p, float* q, F8 a) {
  vectors::store(p, first_four(a));
  vectors::store(q, last_four(a));
}
/// The whole part of each lane.
inline void store_whole(int* p, F8 a) {
  for (int k = 0; k < kParts; ++k)
    vectors::store(p + k * kFloats, __builtin_convertvector(a.part[k], Ints));
}

/// `old` where the mask is 0, the value where it is all ones.
template <typename Vector>
inline Vector mixed(Vector mask, Vector old, Vector fresh) {
  return old ^ ((old ^ fresh) & mask);
}
inline void store_bytes(uint8_t* p, M8 m, uint8_t value) {
  vectors::store(p, vectors::with_value(m.part, vectors::load<EightBytes>(p), value));
}
inline void store_byte_halves(uint8_t* p, uint8_t* q, M8 m, uint8_t value) {
  using TwoInts [[gnu::vector_size(8)]] = int32_t;
  int32_t low, high;
  __builtin_memcpy(&low, p, sizeof low);
  __builtin_memcpy(&high, q, sizeof high);
  const auto old = reinterpret_cast<EightBytes>(TwoInts{low, high});
  const auto both_rows = reinterpret_cast<TwoInts>(vectors::with_value(m.part, old, value));
  low = both_rows[0];
  high = both_rows[1];
  __builtin_memcpy(p, &low, sizeof low);
  __builtin_memcpy(q, &high, sizeof high);
}
inline void store_words(uint32_t* p, M8 m, uint32_t value) {
  const Ints fresh = Ints{} + static_cast<int>(value);
  for (int k = 0; k < kParts; ++k) {
    uint32_t* const at = p + k * kFloats;
    vectors::store(at, mixed(m.part[k], vectors::load<Ints>(at), fresh));
  }
}
inline void store_four_words(uint32_t* p, FourInts mask, uint32_t value) {
  vectors::store(
      p, mixed(mask, vectors::load<FourInts>(p), FourInts{} + static_cast<int>(value)));
}
inline void store_word_halves(uint32_t* p, uint32_t* q, M8 m, uint32_t value) {
  store_four_words(p, first_four(m), value);
  store_four_words(q, last_four(m), value);
}

}  // namespace
}  // namespace sightline::raster

#include "render/raster/raster_loops.inl"
