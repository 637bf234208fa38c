// SPDX-License-Identifier: Apache-2.0
// The loops of raster_kernels.hpp over eight lanes F8/M8, which the including file defines. All of
// it has internal linkage; see raster_kernels.hpp. No function of the standard library here.
// This file: faces in batches, from vertices to pixels.

#include "render/raster/raster_vertices.inl"

#include "render/raster/raster_rows.inl"

namespace sightline::raster {
namespace {

/// Faces on their way through draw(), in plain arrays so that the compiler vectorizes each step.
struct Batch {
  static constexpr size_t kSize = 64;
  size_t count;
  uint32_t face[kSize];
  // Corners p, q, r in ray space; 1/z and pixel of each.
  double px[kSize], py[kSize], qx[kSize], qy[kSize], rx[kSize], ry[kSize];
  float pz[kSize], qz[kSize], rz[kSize];
  float pu[kSize], qu[kSize], ru[kSize], pv[kSize], qv[kSize], rv[kSize];
  float normal_x[kSize], normal_y[kSize], normal_z[kSize], luminance[kSize];

  // Box of the pixels whose center may lie inside, ends excluded; empty where there are none.
  int x0[kSize], y0[kSize], end_x[kSize], end_y[kSize];
  float moved_x[kSize], moved_y[kSize], over[kSize], length2[kSize];
  double area[kSize];  // twice it, with its sign
  // What Triangle holds.
  float origin_x[kSize], origin_y[kSize];
  float a0[kSize], b0[kSize], c0[kSize], a1[kSize], b1[kSize], c1[kSize];
  float a2[kSize], b2[kSize], c2[kSize], epsilon[kSize];
  float inverse_z[kSize], slope_x[kSize], slope_y[kSize];
  float min_inverse_z[kSize], max_inverse_z[kSize];
  int shade[kSize];
};

/// Takes faces off the list until the batch is full; returns how many. Those with a corner that has
/// no pixel are put off.
size_t gather(DrawJob& job, size_t begin, Batch& b) {
  size_t n = 0;
  size_t i = begin;
  for (; i < job.count && n < Batch::kSize; ++i) {
    const uint32_t face = job.list[i];
    const ProjectedVertex& p = job.vertices[job.faces[face][0]];
    const ProjectedVertex& q = job.vertices[job.faces[face][1]];
    const ProjectedVertex& r = job.vertices[job.faces[face][2]];
    if ((p.flags | q.flags | r.flags) != 0) [[unlikely]] {
      if ((p.flags & q.flags & r.flags & kBehind) == 0) job.deferred[job.deferred_count++] = face;
      continue;
    }
    b.face[n] = face;
    b.px[n] = p.x, b.py[n] = p.y, b.pz[n] = p.inverse_z, b.pu[n] = p.u, b.pv[n] = p.v;
    b.qx[n] = q.x, b.qy[n] = q.y, b.qz[n] = q.inverse_z, b.qu[n] = q.u, b.qv[n] = q.v;
    b.rx[n] = r.x, b.ry[n] = r.y, b.rz[n] = r.inverse_z, b.ru[n] = r.u, b.rv[n] = r.v;
    b.normal_x[n] = job.normal_x[face];
    b.normal_y[n] = job.normal_y[face];
    b.normal_z[n] = job.normal_z[face];
    b.luminance[n] = job.luminance[face];
    ++n;
  }
  b.count = n;
  return i - begin;
}

/// Edge functions from the corners, in double as far as differences go. Written without a choice,
/// so that it vectorizes: a face that turns the other way has the same functions with the other
/// sign.
void set_up_edges(Batch& b) {
  for (size_t i = 0; i < b.count; ++i) {
    const double px = b.px[i], py = b.py[i];
    const double qx = b.qx[i] - px, qy = b.qy[i] - py;
    const double rx = b.rx[i] - px, ry = b.ry[i] - py;
    const double area = qx * ry - qy * rx;
    const double sign = __builtin_copysign(1.0, area);
    const float origin_x = static_cast<float>(px);
    const float origin_y = static_cast<float>(py);
    // What rounding the origin moved, in each edge function.
    const double ox = px - double{origin_x};
    const double oy = py - double{origin_y};
    const double moved_q = qy * ox - qx * oy;
    const double moved_r = rx * oy - ry * ox;
    b.area[i] = area;
    b.origin_x[i] = origin_x;
    b.origin_y[i] = origin_y;
    b.moved_x[i] = static_cast<float>(ox);
    b.moved_y[i] = static_cast<float>(oy);
    b.over[i] = static_cast<float>(1 / __builtin_fabs(area));
    b.a0[i] = static_cast<float>(-qy * sign);
    b.b0[i] = static_cast<float>(qx * sign);
    b.c0[i] = static_cast<float>(moved_q * sign);
    b.a1[i] = static_cast<float>(ry * sign);
    b.b1[i] = static_cast<float>(-rx * sign);
    b.c1[i] = static_cast<float>(moved_r * sign);
    b.a2[i] = static_cast<float>((qy - ry) * sign);
    b.b2[i] = static_cast<float>((rx - qx) * sign);
    b.c2[i] = static_cast<float>((area - moved_q - moved_r) * sign);
    // The longest edge squared is at most twice this.
    b.length2[i] = static_cast<float>(qx * qx + qy * qy + rx * rx + ry * ry);
  }
}

void set_up_depth(const DrawJob& job, Batch& b) {
  const float reach_x = job.reach_x, reach_y = job.reach_y;
  const float ray_error = kRayError * job.largest_ray;
  for (size_t i = 0; i < b.count; ++i) {
    const float a0 = b.a0[i], b0 = b.b0[i], a1 = b.a1[i], b1 = b.b1[i];
    const float span_x = __builtin_fabsf(b0) + __builtin_fabsf(b1);
    const float span_y = __builtin_fabsf(a0) + __builtin_fabsf(a1);
    b.epsilon[i] = kTermError * (span_y * reach_x + span_x * reach_y + 4 * span_x * span_y) +
                   ray_error * (span_x + span_y);
    const float p = b.pz[i], q = b.qz[i], r = b.rz[i], over = b.over[i];
    const float zq = q - p, zr = r - p;
    const float slope_x = (zq * a1 + zr * a0) * over;
    const float slope_y = (zr * b0 + zq * b1) * over;
    b.slope_x[i] = slope_x;
    b.slope_y[i] = slope_y;
    b.inverse_z[i] = p - slope_x * b.moved_x[i] - slope_y * b.moved_y[i];
    b.min_inverse_z[i] = smaller(smaller(p, q), r);
    b.max_inverse_z[i] = larger(larger(p, q), r);
  }
}

void set_up_boxes(const DrawJob& job, Batch& b) {
  const F8 last_x = set1(static_cast<float>(job.target.width - 1));
  const F8 last_y = set1(static_cast<float>(job.target.height - 1));
  const F8 margin = set1(job.box_margin), bulge = set1(job.bulge * 2), first = set1(0);
  const F8 almost_one = set1(0.999f), one = set1(1);
  for (size_t i = 0; i < b.count; i += 8) {
    const F8 pu = load(b.pu + i), qu = load(b.qu + i), ru = load(b.ru + i);
    const F8 pv = load(b.pv + i), qv = load(b.qv + i), rv = load(b.rv + i);
    const F8 grow = add(margin, mul(bulge, load(b.length2 + i)));
    // A little less than the ceiling is safe; a pixel more costs time only. Kept one pixel around
    // the tile and counted from there, boxes outside it end up empty and truncation rounds down.
    const F8 u0 = min(max(sub(min(min(pu, qu), ru), grow), first), add(last_x, one));
    const F8 v0 = min(max(sub(min(min(pv, qv), rv), grow), first), add(last_y, one));
    const F8 u1 = max(add(min(add(max(max(pu, qu), ru), grow), last_x), one), first);
    const F8 v1 = max(add(min(add(max(max(pv, qv), rv), grow), last_y), one), first);
    store_whole(b.x0 + i, add(u0, almost_one));
    store_whole(b.y0 + i, add(v0, almost_one));
    store_whole(b.end_x + i, u1);
    store_whole(b.end_y + i, v1);
  }
}

void set_up_shade(const DrawJob& job, Batch& b) {
  const float light_x = job.light_x, light_y = job.light_y, light_z = job.light_z;
  const float ambient = job.ambient, rest = 1 - job.ambient;
  for (size_t i = 0; i < b.count; ++i) {
    const float towards =
        b.normal_x[i] * light_x + b.normal_y[i] * light_y + b.normal_z[i] * light_z;
    // Seen from the front, a face turns against the axes (y points down): negative area.
    const float lambert = larger(b.area[i] > 0 ? -towards : towards, 0.0f);
    b.shade[i] = static_cast<int>(255.0f * (ambient + rest * lambert) * b.luminance[i] + 0.5f);
  }
}

Triangle triangle_of(const DrawJob& job, const Batch& b, size_t i) {
  return {b.origin_x[i],
          b.origin_y[i],
          {b.a0[i], b.a1[i], b.a2[i], 0},
          {b.b0[i], b.b1[i], b.b2[i], 0},
          {b.c0[i], b.c1[i], b.c2[i], 0},
          b.epsilon[i],
          b.inverse_z[i],
          b.slope_x[i],
          b.slope_y[i],
          b.min_inverse_z[i],
          b.max_inverse_z[i],
          static_cast<uint8_t>(b.shade[i]),
          b.face[i],
          job.decide,
          job.context};
}

/// What eight pixels of a small face need, in every lane.
struct Lanes {
  F8 a0, b0, c0, a1, b1, c1, a2, b2, c2, origin_x, origin_y, above, below;
  F8 slope_x, slope_y, inverse_z, min_inverse_z, max_inverse_z;
};

inline Lanes lanes_of(const Batch& b, size_t i) {
  return {set1(b.a0[i]),
          set1(b.b0[i]),
          set1(b.c0[i]),
          set1(b.a1[i]),
          set1(b.b1[i]),
          set1(b.c1[i]),
          set1(b.a2[i]),
          set1(b.b2[i]),
          set1(b.c2[i]),
          set1(b.origin_x[i]),
          set1(b.origin_y[i]),
          set1(b.epsilon[i]),
          set1(-b.epsilon[i]),
          set1(b.slope_x[i]),
          set1(b.slope_y[i]),
          set1(b.inverse_z[i]),
          set1(b.min_inverse_z[i]),
          set1(b.max_inverse_z[i])};
}

/// Which of eight rays hit, and at what 1/z. `decide(open)` settles lanes that float leaves open.
template <typename DecideOpen>
inline M8 hit(const Lanes& t, F8 ray_x, F8 ray_y, const DecideOpen& decide_open, F8& z) {
  const F8 dx = sub(ray_x, t.origin_x);
  const F8 dy = sub(ray_y, t.origin_y);
  const F8 e0 = add(add(mul(t.a0, dx), mul(t.b0, dy)), t.c0);
  const F8 e1 = add(add(mul(t.a1, dx), mul(t.b1, dy)), t.c1);
  const F8 e2 = add(add(mul(t.a2, dx), mul(t.b2, dy)), t.c2);
  const F8 smallest = min(e2, min(e1, e0));
  M8 inside = greater(smallest, t.above);
  const unsigned maybe = bits(greater(smallest, t.below));
  const unsigned sure = bits(inside);
  if (maybe != sure) [[unlikely]]
    inside = from_bits(sure | decide_open(maybe & ~sure));
  z = add(add(mul(t.slope_x, dx), mul(t.slope_y, dy)), t.inverse_z);
  z = max(min(z, t.max_inverse_z), t.min_inverse_z);
  return inside;
}

/// A face of up to eight pixels' width: one step a row.
template <bool kFaces>
inline void draw_single_rows(const DrawJob& job, const Batch& b, size_t i, size_t rows_wanted) {
  const Target& target = job.target;
  const Lanes t = lanes_of(b, i);
  // Near the right end the step begins further left, so that it stays in the row.
  const int last = static_cast<int>(target.stride) - 8;
  const int x = b.x0[i] < last ? b.x0[i] : last;
  const size_t at = static_cast<size_t>(b.y0[i]) * target.stride + static_cast<size_t>(x);
  const size_t from = static_cast<size_t>(b.y0[i]) * target.ray_stride + static_cast<size_t>(x);
  float* depth = target.depth + at;
  Fill fill = Fill::at<kFaces>(target, at);
  const float* ray_x = target.ray_x + from;
  const float* ray_y = target.ray_y + from;
  for (size_t row = 0; row < rows_wanted; ++row) {
    F8 z;
    const M8 inside = hit(
        t, load(ray_x), load(ray_y),
        [&](unsigned open) {
          return decide_lanes(job, b.face[i], open, x, b.y0[i] + static_cast<int>(row));
        },
        z);
    const F8 old = load(depth);
    const M8 drawn = both(inside, greater(z, old));
    store(depth, select(drawn, z, old));
    fill.put<kFaces>(0, drawn, b.shade[i], b.face[i]);
    depth += target.stride, fill.advance<kFaces>(target.stride);
    ray_x += target.ray_stride, ray_y += target.ray_stride;
  }
}

/// A face of up to four pixels' width: two rows at a step. Of an odd height one row more is
/// visited, where nothing is hit.
template <bool kFaces>
inline void draw_row_pairs(const DrawJob& job, const Batch& b, size_t i, size_t pairs) {
  const Target& target = job.target;
  const Lanes t = lanes_of(b, i);
  const int last_x = static_cast<int>(target.stride) - 4;
  const int last_y = target.height - 2 * static_cast<int>(pairs);
  const int x = b.x0[i] < last_x ? b.x0[i] : last_x;
  const int y = b.y0[i] < last_y ? b.y0[i] : last_y;
  const size_t stride = target.stride, ray_stride = target.ray_stride;
  const size_t at = static_cast<size_t>(y) * stride + static_cast<size_t>(x);
  const size_t from = static_cast<size_t>(y) * ray_stride + static_cast<size_t>(x);
  float* depth = target.depth + at;
  Fill fill = Fill::at<kFaces>(target, at);
  const float* ray_x = target.ray_x + from;
  const float* ray_y = target.ray_y + from;
  for (size_t pair = 0; pair < pairs; ++pair) {
    F8 z;
    const M8 inside = hit(
        t, load_halves(ray_x, ray_x + ray_stride), load_halves(ray_y, ray_y + ray_stride),
        [&](unsigned open) {
          const int row = y + 2 * static_cast<int>(pair);
          return decide_lanes(job, b.face[i], open & 15u, x, row) |
                 decide_lanes(job, b.face[i], open >> 4, x, row + 1) << 4;
        },
        z);
    const F8 old = load_halves(depth, depth + stride);
    const M8 drawn = both(inside, greater(z, old));
    store_halves(depth, depth + stride, select(drawn, z, old));
    fill.put_halves<kFaces>(stride, drawn, b.shade[i], b.face[i]);
    depth += 2 * stride, fill.advance<kFaces>(2 * stride);
    ray_x += 2 * ray_stride, ray_y += 2 * ray_stride;
  }
}

/// Faces of a batch in order of how many steps they take: a loop that turns as often as the one
/// before it is predicted well, and a wrong guess costs as much as two steps.
struct StepOrder {
  static constexpr size_t kMax = 16;  ///< rows
  // Keys: 0 .. 7 one to eight pairs of rows, 8 .. 23 one to sixteen rows, then any other.
  static constexpr size_t kSingle = kMax / 2, kLarge = kSingle + kMax, kNone = kLarge + 1;
  uint8_t key[Batch::kSize];
  uint8_t face[Batch::kSize];
  size_t end[kNone + 1];  ///< of each key, in `face`

  void sort(const DrawJob& job, const Batch& b) {
    size_t begin[kNone + 1] = {};
    for (size_t i = 0; i < b.count; ++i) {
      key[i] = static_cast<uint8_t>(key_of(job, b, i));
      ++begin[key[i]];
    }
    size_t sum = 0;
    for (size_t k = 0; k <= kNone; ++k) {
      const size_t count = begin[k];
      begin[k] = sum;
      sum += count;
      end[k] = sum;
    }
    for (size_t i = 0; i < b.count; ++i) face[begin[key[i]]++] = static_cast<uint8_t>(i);
  }

  static size_t key_of(const DrawJob& job, const Batch& b, size_t i) {
    const bool shown = job.cull ? b.area[i] < 0 : b.area[i] != 0;
    const int width = b.end_x[i] - b.x0[i];
    const int height = b.end_y[i] - b.y0[i];
    const size_t rows_wanted = static_cast<size_t>(height);
    size_t k = width <= 4 ? (rows_wanted - 1) / 2 : kSingle + rows_wanted - 1;
    k = width > 8 || rows_wanted > kMax ? kLarge : k;
    return !shown || width <= 0 || height <= 0 ? kNone : k;
  }
};

template <bool kFaces>
void draw_batch(DrawJob& job, const Batch& b) {
  StepOrder order;
  order.sort(job, b);
  size_t k = 0;
  for (size_t pairs = 1; pairs <= StepOrder::kSingle; ++pairs) {
    for (; k < order.end[pairs - 1]; ++k) draw_row_pairs<kFaces>(job, b, order.face[k], pairs);
  }
  for (size_t count = 1; count <= StepOrder::kMax; ++count) {
    for (; k < order.end[StepOrder::kSingle + count - 1]; ++k)
      draw_single_rows<kFaces>(job, b, order.face[k], count);
  }
  for (; k < order.end[StepOrder::kLarge]; ++k) {
    const size_t i = order.face[k];
    if (b.end_x[i] - b.x0[i] > kSmallBox || b.end_y[i] - b.y0[i] > kSmallBox) {
      job.deferred[job.deferred_count++] = b.face[i];
    } else {
      draw_rows<kFaces, false, false>(job.target, triangle_of(job, b, i), b.x0[i], b.y0[i],
                                      b.end_x[i] - 1, b.end_y[i] - 1);
    }
  }
}

template <bool kFaces>
void draw(DrawJob& job) {
  Batch b{};
  job.deferred_count = 0;
  for (size_t begin = 0; begin < job.count;) {
    begin += gather(job, begin, b);
    set_up_edges(b);
    set_up_depth(job, b);
    set_up_boxes(job, b);
    set_up_shade(job, b);
    draw_batch<kFaces>(job, b);
  }
}

constexpr Kernels kKernels{project,
                           cull,
                           {draw<false>, rows<false>, rows_near<false>},
                           {draw<true>, rows<true>, rows_near<true>}};

}  // namespace
}  // namespace sightline::raster
