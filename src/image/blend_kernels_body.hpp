// SPDX-License-Identifier: Apache-2.0
// The vector kernels' one source, compiled once for any processor of the target (SSE2, NEON) and
// once for AVX2. Each vector of bytes is worked on as 16-bit lanes that hold an even byte low and
// an odd one high: no lane moves.
#include "image/blend_kernels.hpp"
#include "sightline/base/vectors.hpp"

namespace sightline::image::blend {
namespace {

using namespace sightline::vectors;

// attenuate() of each lane, times 256 and with more below; `keep` holds 255 - alpha.
inline Shorts attenuate256(Shorts in, Shorts keep) {
  const Shorts t = in * keep + 128;
  return t + (t >> 8);
}

// over() on a vector of bytes: even and odd bytes have what they keep of the frame in lanes of
// their own.
inline Bytes over(Bytes in, Bytes color, Shorts keep_even, Shorts keep_odd) {
  const auto lanes = reinterpret_cast<Shorts>(in);
  const Shorts even = attenuate256(lanes & 0xff, keep_even) >> 8;
  const Shorts odd = attenuate256(lanes >> 8, keep_odd) & 0xff00;
  const auto rest = reinterpret_cast<Bytes>(even | odd);
  const Bytes room = ~color;  // saturates
  return color + (rest < room ? rest : room);
}

inline void over_plane(uint8_t* frame, Bytes color, Bytes alpha) {
  const auto keep = reinterpret_cast<Shorts>(~alpha);
  store(frame, over(load<Bytes>(frame), color, keep & 0xff, keep >> 8));
}

inline Shorts widened(HalfBytes bytes) { return __builtin_convertvector(bytes, Shorts); }

inline void over_pairs(uint8_t* frame_uv, HalfBytes u, HalfBytes v, HalfBytes alpha) {
  const Shorts keep = 255 - widened(alpha);
  const auto color = reinterpret_cast<Bytes>(widened(u) | widened(v) << 8);
  store(frame_uv, over(load<Bytes>(frame_uv), color, keep, keep));
}

// Most of a tile is empty: such stretches leave the frame's memory alone.
inline bool empty(Bytes color, Bytes alpha) { return !any(color | alpha); }
inline bool empty(HalfBytes u, HalfBytes v, HalfBytes alpha) {
  const HalfBytes all = u | v | alpha;
  uint64_t words[kBytes / 16];
  __builtin_memcpy(words, &all, sizeof words);
  uint64_t bits = 0;
  for (const uint64_t word : words) bits |= word;
  return bits == 0;
}

/// 255 in the last `count` bytes of a vector of so many.
template <typename Vector>
inline Vector last_bytes(int count) {
  constexpr int kSize = sizeof(Vector);
  static constexpr struct Edge {
    uint8_t bytes[2 * kSize] = {};
    constexpr Edge() {
      for (int i = kSize; i < 2 * kSize; ++i) bytes[i] = 255;
    }
  } kEdge;
  return load<Vector>(kEdge.bytes + count);
}

inline void plane_row(uint8_t* frame, const uint8_t* color, const uint8_t* alpha, int n) {
  int i = 0;
  for (; i + kBytes <= n; i += kBytes) {
    const Bytes c = load<Bytes>(color + i), a = load<Bytes>(alpha + i);
    if (!empty(c, a)) over_plane(frame + i, c, a);
  }
  if (i == n) return;
  if (n < kBytes) {
    plane_row_scalar(frame, color, alpha, n);
    return;
  }
  // The last ones once more: transparent where they are done.
  const int last = n - kBytes;
  const Bytes open = last_bytes<Bytes>(n - i);
  const Bytes c = load<Bytes>(color + last) & open, a = load<Bytes>(alpha + last) & open;
  if (!empty(c, a)) over_plane(frame + last, c, a);
}

inline void pair_row(uint8_t* frame_uv, const uint8_t* u, const uint8_t* v, const uint8_t* alpha,
                     int n) {
  constexpr int kPairs = kBytes / 2;
  int i = 0;
  for (; i + kPairs <= n; i += kPairs) {
    const auto cu = load<HalfBytes>(u + i), cv = load<HalfBytes>(v + i);
    const auto a = load<HalfBytes>(alpha + i);
    if (!empty(cu, cv, a)) over_pairs(frame_uv + 2 * i, cu, cv, a);
  }
  if (i == n) return;
  if (n < kPairs) {
    pair_row_scalar(frame_uv, u, v, alpha, n);
    return;
  }
  const int last = n - kPairs;
  const auto open = last_bytes<HalfBytes>(n - i);
  const HalfBytes cu = load<HalfBytes>(u + last) & open, cv = load<HalfBytes>(v + last) & open;
  const HalfBytes a = load<HalfBytes>(alpha + last) & open;
  if (!empty(cu, cv, a)) over_pairs(frame_uv + 2 * last, cu, cv, a);
}

}  // namespace
}  // namespace sightline::image::blend
