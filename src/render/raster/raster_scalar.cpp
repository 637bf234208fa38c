// SPDX-License-Identifier: Apache-2.0
#include "render/raster/raster_kernels.hpp"

namespace sightline::raster {
namespace {

constexpr int kLanes = 8;
struct F8 {
  float v[kLanes];
};
struct M8 {
  bool v[kLanes];
};

template <typename Make>
inline F8 each(Make make) {
  F8 out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = make(i);
  return out;
}
inline F8 load(const float* p) {
  return each([p](int i) { return p[i]; });
}
inline F8 load_halves(const float* p, const float* q) {
  return each([p, q](int i) { return i < 4 ? p[i] : q[i - 4]; });
}
inline F8 set1(float a) {
  return each([a](int) { return a; });
}
inline F8 add(const F8& a, const F8& b) {
  return each([&](int i) { return a.v[i] + b.v[i]; });
}
inline F8 sub(const F8& a, const F8& b) {
  return each([&](int i) { return a.v[i] - b.v[i]; });
}
inline F8 mul(const F8& a, const F8& b) {
  return each([&](int i) { return a.v[i] * b.v[i]; });
}
inline F8 min(const F8& a, const F8& b) {
  return each([&](int i) { return a.v[i] < b.v[i] ? a.v[i] : b.v[i]; });
}
inline F8 max(const F8& a, const F8& b) {
  return each([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
}
inline M8 greater(const F8& a, const F8& b) {
  M8 out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = a.v[i] > b.v[i];
  return out;
}
inline M8 both(const M8& a, const M8& b) {
  M8 out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = a.v[i] && b.v[i];
  return out;
}
inline unsigned bits(const M8& a) {
  unsigned out = 0;
  for (int i = 0; i < kLanes; ++i) out |= static_cast<unsigned>(a.v[i]) << i;
  return out;
}
inline M8 from_bits(unsigned b) {
  M8 out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = (b >> i & 1u) != 0;
  return out;
}
inline F8 select(const M8& m, const F8& a, const F8& b) {
  return each([&](int i) { return m.v[i] ? a.v[i] : b.v[i]; });
}
inline void store(float* p, const F8& a) {
  for (int i = 0; i < kLanes; ++i) p[i] = a.v[i];
}
inline void store_halves(float* p, float* q, const F8& a) {
  for (int i = 0; i < 4; ++i) p[i] = a.v[i];
  for (int i = 0; i < 4; ++i) q[i] = a.v[i + 4];
}
inline void store_whole(int* p, const F8& a) {
  for (int i = 0; i < kLanes; ++i) p[i] = static_cast<int>(a.v[i]);
}
inline void store_bytes(uint8_t* p, const M8& m, uint8_t value) {
  for (int i = 0; i < kLanes; ++i) p[i] = m.v[i] ? value : p[i];
}
inline void store_byte_halves(uint8_t* p, uint8_t* q, const M8& m, uint8_t value) {
  for (int i = 0; i < 4; ++i) p[i] = m.v[i] ? value : p[i];
  for (int i = 0; i < 4; ++i) q[i] = m.v[i + 4] ? value : q[i];
}

inline void store_words(uint32_t* p, const M8& m, uint32_t value) {
  for (int i = 0; i < kLanes; ++i) p[i] = m.v[i] ? value : p[i];
}
inline void store_word_halves(uint32_t* p, uint32_t* q, const M8& m, uint32_t value) {
  for (int i = 0; i < 4; ++i) p[i] = m.v[i] ? value : p[i];
  for (int i = 0; i < 4; ++i) q[i] = m.v[i + 4] ? value : q[i];
}

}  // namespace
}  // namespace sightline::raster

#include "render/raster/raster_loops.inl"

namespace sightline::raster {

const Kernels& scalar_kernels() { return kKernels; }

}  // namespace sightline::raster
