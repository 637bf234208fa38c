// SPDX-License-Identifier: Apache-2.0
// Pixels of one triangle, row by row; part of raster_loops.inl.

namespace sightline::raster {
namespace {

/// Lanes that float arithmetic left open, decided one by one.
template <typename Asker>  // a DrawJob or a Triangle
[[gnu::noinline, gnu::cold]] unsigned decide_lanes(const Asker& ask, uint32_t face, unsigned open,
                                                   int x, int y) {
  unsigned inside = 0;
  for (int lane = 0; lane < 8; ++lane) {
    if ((open >> lane & 1u) != 0 && ask.decide(ask.context, face, x + lane, y))
      inside |= 1u << lane;
  }
  return inside;
}

/// Both planes at one place; which of them a kernel fills is known when it is compiled.
struct Fill {
  uint8_t* shade;
  uint32_t* face;

  template <bool kFaces>
  static Fill at(const Target& target, size_t offset) {
    if constexpr (kFaces) return {nullptr, target.face + offset};
    return {target.shade + offset, nullptr};
  }
  template <bool kFaces>
  void put(size_t x, M8 drawn, int level, uint32_t number) const {
    if constexpr (kFaces) {
      store_words(face + x, drawn, number);
    } else {
      store_bytes(shade + x, drawn, static_cast<uint8_t>(level));
    }
  }
  /// Four pixels here and four a row further.
  template <bool kFaces>
  void put_halves(size_t stride, M8 drawn, int level, uint32_t number) const {
    if constexpr (kFaces) {
      store_word_halves(face, face + stride, drawn, number);
    } else {
      store_byte_halves(shade, shade + stride, drawn, static_cast<uint8_t>(level));
    }
  }
  template <bool kFaces>
  void advance(size_t count) {
    if constexpr (kFaces) {
      face += count;
    } else {
      shade += count;
    }
  }
};

/// `kSkipEmpty` pays for long rows; in small triangles the branch is mispredicted too often.
template <bool kFaces, bool kNear, bool kSkipEmpty>
inline void draw_rows(const Target& target, const Triangle& t, int x0, int y0, int x1, int y1) {
  constexpr int kEdges = kNear ? 4 : 3;
  F8 a[kEdges], b[kEdges], c[kEdges];
  for (int k = 0; k < kEdges; ++k) {
    a[k] = set1(t.a[k]);
    b[k] = set1(t.b[k]);
    c[k] = set1(t.c[k]);
  }
  const F8 origin_x = set1(t.origin_x);
  const F8 origin_y = set1(t.origin_y);
  const F8 above = set1(t.epsilon);
  const F8 below = set1(-t.epsilon);
  // As few steps as the width needs, further left where the row would end before the last one.
  const int steps = (x1 - x0 + 8) >> 3;
  const int last = static_cast<int>(target.stride) - 8 * steps;
  const int first = x0 < last ? x0 : last;
  for (int y = y0; y <= y1; ++y) {
    const float* const ray_x = target.ray_x + static_cast<size_t>(y) * target.ray_stride;
    const float* const ray_y = target.ray_y + static_cast<size_t>(y) * target.ray_stride;
    float* const depth = target.depth + static_cast<size_t>(y) * target.stride;
    const Fill fill = Fill::at<kFaces>(target, static_cast<size_t>(y) * target.stride);
    for (int x = first; x <= x1; x += 8) {
      const F8 dx = sub(load(ray_x + x), origin_x);
      const F8 dy = sub(load(ray_y + x), origin_y);
      F8 smallest = add(add(mul(a[0], dx), mul(b[0], dy)), c[0]);
      for (int k = 1; k < kEdges; ++k) smallest = min(add(add(mul(a[k], dx), mul(b[k], dy)), c[k]), smallest);
      const unsigned maybe = bits(greater(smallest, below));
      if (kSkipEmpty && maybe == 0) continue;
      M8 inside = greater(smallest, above);
      const unsigned sure = bits(inside);
      if (maybe != sure) [[unlikely]]
        inside = from_bits(sure | decide_lanes(t, t.face, maybe & ~sure, x, y));
      F8 z = add(add(mul(set1(t.slope_x), dx), mul(set1(t.slope_y), dy)), set1(t.inverse_z));
      z = max(min(z, set1(t.max_inverse_z)), set1(t.min_inverse_z));
      const F8 old = load(depth + x);
      const M8 drawn = both(inside, greater(z, old));
      store(depth + x, select(drawn, z, old));
      fill.put<kFaces>(static_cast<size_t>(x), drawn, t.shade, t.face);
    }
  }
}

template <bool kFaces>
void rows(const Target& target, const Triangle& t, int x0, int y0, int x1, int y1) {
  draw_rows<kFaces, false, true>(target, t, x0, y0, x1, y1);
}

template <bool kFaces>
void rows_near(const Target& target, const Triangle& t, int x0, int y0, int x1, int y1) {
  draw_rows<kFaces, true, true>(target, t, x0, y0, x1, y1);
}

}  // namespace
}  // namespace sightline::raster
