// SPDX-License-Identifier: Apache-2.0
// The loops of raster_kernels.hpp over eight lanes F8/M8, which the including file defines. All of
// it has internal linkage; see raster_kernels.hpp. No function of the standard library here.

namespace sightline::raster {
namespace {

inline double absolute(double a) { return a < 0 ? -a : a; }
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

constexpr size_t kChunk = 64;

/// Vertices in chunks of plain arrays, so that the compiler vectorises each step.
void project_chunk(const ProjectJob& job, size_t begin, size_t count) {
  double rx[kChunk], ry[kChunk], depth[kChunk];
  float u[kChunk], v[kChunk], radius[kChunk];
  const float* const xs = job.x + begin;
  const float* const ys = job.y + begin;
  const float* const zs = job.z + begin;
  const double* const r = job.rotation;
  const double* const t = job.translation;
  for (size_t i = 0; i < count; ++i) {
    const double x = double{xs[i]};
    const double y = double{ys[i]};
    const double z = double{zs[i]};
    const double cz = r[6] * x + r[7] * y + r[8] * z + t[2];
    const double over = 1 / cz;
    rx[i] = (r[0] * x + r[1] * y + r[2] * z + t[0]) * over;
    ry[i] = (r[3] * x + r[4] * y + r[5] * z + t[1]) * over;
    depth[i] = cz;
  }
  for (size_t i = 0; i < count; ++i) {
    const float x = static_cast<float>(rx[i]);
    const float y = static_cast<float>(ry[i]);
    const float r2 = x * x + y * y;
    radius[i] = r2;
    float s = (1 - 1 / __builtin_sqrtf(1 + r2)) * job.scale;
    s = s < job.last_cell ? s : job.last_cell;
    const int cell = static_cast<int>(s);
    const float factor = job.value[cell] + (s - static_cast<float>(cell)) * job.step[cell];
    u[i] = job.fx * (x * factor + 2 * job.p1 * x * y + job.p2 * (r2 + 2 * x * x)) + job.cx;
    v[i] = job.fy * (y * factor + job.p1 * (r2 + 2 * y * y) + 2 * job.p2 * x * y) + job.cy;
  }
  for (size_t i = 0; i < count; ++i) {
    uint32_t flags = depth[i] < job.near_z ? kBehind : 0;
    if (!(radius[i] <= job.max_radius_squared)) flags |= kBeyond;
    job.out[begin + i] = {rx[i], ry[i], static_cast<float>(1 / depth[i]), u[i], v[i], flags};
  }
}

void project(const ProjectJob& job) {
  size_t i = 0;
  for (; i + kChunk <= job.count; i += kChunk) project_chunk(job, i, kChunk);
  if (i < job.count) project_chunk(job, i, job.count - i);
}

size_t cull(const CullJob& job) {
  float side[kChunk];
  size_t kept = 0;
  for (size_t begin = 0; begin < job.count; begin += kChunk) {
    const size_t count = job.count - begin < kChunk ? job.count - begin : kChunk;
    const float* const nx = job.normal_x + begin;
    const float* const ny = job.normal_y + begin;
    const float* const nz = job.normal_z + begin;
    const float* const offset = job.offset + begin;
    for (size_t i = 0; i < count; ++i)
      side[i] = nx[i] * job.eye_x + ny[i] * job.eye_y + nz[i] * job.eye_z - offset[i];
    for (size_t i = 0; i < count; ++i) {
      job.out[kept] = static_cast<uint32_t>(begin + i);
      kept += side[i] > -job.tolerance ? 1 : 0;
    }
  }
  return kept;
}

/// Lanes that float arithmetic left open, decided one by one.
[[gnu::noinline, gnu::cold]] unsigned decide_lanes(const Triangle& t, unsigned open, int x, int y) {
  unsigned hit = 0;
  for (int lane = 0; lane < 8; ++lane) {
    if ((open >> lane & 1u) != 0 && t.decide(t.context, t.face, x + lane, y)) hit |= 1u << lane;
  }
  return hit;
}

/// `kSkipEmpty` pays for long rows; in small triangles the branch is mispredicted too often.
template <bool kNear, bool kSkipEmpty>
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
  // Columns start at multiples of eight: aligned, and stores forward to later loads.
  const int first = x0 & ~7;
  for (int y = y0; y <= y1; ++y) {
    const float* const ray_x = target.ray_x + static_cast<size_t>(y) * target.ray_stride;
    const float* const ray_y = target.ray_y + static_cast<size_t>(y) * target.ray_stride;
    float* const depth = target.depth + static_cast<size_t>(y) * target.stride;
    uint8_t* const shade = target.shade + static_cast<size_t>(y) * target.stride;
    for (int x = first; x <= x1; x += 8) {
      const F8 dx = sub(load(ray_x + x), origin_x);
      const F8 dy = sub(load(ray_y + x), origin_y);
      F8 least = add(add(mul(a[0], dx), mul(b[0], dy)), c[0]);
      for (int k = 1; k < kEdges; ++k)
        least = min(add(add(mul(a[k], dx), mul(b[k], dy)), c[k]), least);
      const unsigned maybe = bits(greater(least, below));
      if (kSkipEmpty && maybe == 0) continue;
      M8 inside = greater(least, above);
      const unsigned sure = bits(inside);
      if (maybe != sure) [[unlikely]]
        inside = from_bits(sure | decide_lanes(t, maybe & ~sure, x, y));
      F8 z = add(add(mul(set1(t.slope_x), dx), mul(set1(t.slope_y), dy)), set1(t.inverse_z));
      z = max(min(z, set1(t.max_inverse_z)), set1(t.min_inverse_z));
      const F8 old = load_aligned(depth + x);
      const M8 drawn = both(inside, greater(z, old));
      store_aligned(depth + x, select(drawn, z, old));
      store_bytes(shade + x, drawn, t.shade);
    }
  }
}

void rows(const Target& target, const Triangle& t, int x0, int y0, int x1, int y1) {
  draw_rows<false, true>(target, t, x0, y0, x1, y1);
}

void rows_near(const Target& target, const Triangle& t, int x0, int y0, int x1, int y1) {
  draw_rows<true, true>(target, t, x0, y0, x1, y1);
}

struct Box {
  int x0, y0, x1, y1;
};

/// Pixels whose centre may lie inside; false if there are none.
inline bool pixel_box(const DrawJob& job, const ProjectedVertex& p, const ProjectedVertex& q,
                      const ProjectedVertex& r, float margin, Box& box) {
  const float u0 = larger(smaller(smaller(p.u, q.u), r.u) - margin, 0);
  const float v0 = larger(smaller(smaller(p.v, q.v), r.v) - margin, 0);
  const float u1 =
      smaller(larger(larger(p.u, q.u), r.u) + margin, static_cast<float>(job.target.width - 1));
  const float v1 =
      smaller(larger(larger(p.v, q.v), r.v) + margin, static_cast<float>(job.target.height - 1));
  if (!(u0 <= u1) || !(v0 <= v1)) return false;
  // A little less than the ceiling is safe; a pixel more costs time only.
  box = {static_cast<int>(u0 + 0.999f), static_cast<int>(v0 + 0.999f), static_cast<int>(u1),
         static_cast<int>(v1)};
  return box.x0 <= box.x1 && box.y0 <= box.y1;
}

inline uint8_t shade_of(const DrawJob& job, uint32_t face, bool turned) {
  float lambert = job.normal_x[face] * job.light_x + job.normal_y[face] * job.light_y +
                  job.normal_z[face] * job.light_z;
  if (turned) lambert = -lambert;
  lambert = lambert > 0 ? lambert : 0;
  const float level = job.ambient + (1 - job.ambient) * lambert;
  return static_cast<uint8_t>(255.0f * level * job.luminance[face] + 0.5f);
}

void draw(DrawJob& job) {
  Triangle t;
  t.decide = job.decide;
  t.context = job.context;
  job.deferred_count = 0;
  for (size_t i = 0; i < job.count; ++i) {
    const uint32_t face = job.list[i];
    const ProjectedVertex& p = job.vertices[job.faces[face][0]];
    const ProjectedVertex* q = &job.vertices[job.faces[face][1]];
    const ProjectedVertex* r = &job.vertices[job.faces[face][2]];
    if ((p.flags | q->flags | r->flags) != 0) [[unlikely]] {
      if ((p.flags & q->flags & r->flags & kBehind) == 0) job.deferred[job.deferred_count++] = face;
      continue;
    }
    double qx = q->x - p.x, qy = q->y - p.y, rx = r->x - p.x, ry = r->y - p.y;
    double area = qx * ry - qy * rx;
    // Seen from the front, a face turns against the axes (y points down): negative area.
    const bool turned = area > 0;
    if (turned && job.cull) continue;
    if (area == 0) continue;
    const double length2 = qx * qx + qy * qy + rx * rx + ry * ry;  // longest edge^2 <= 2 of it
    const float bulge = job.bulge * 2 * static_cast<float>(length2);
    Box box;
    if (!pixel_box(job, p, *q, *r, job.box_margin + bulge, box)) continue;
    if (box.x1 - box.x0 >= kSmallBox || box.y1 - box.y0 >= kSmallBox) {
      job.deferred[job.deferred_count++] = face;
      continue;
    }
    if (!turned) {
      const double sx = qx, sy = qy;
      qx = rx, qy = ry, rx = sx, ry = sy;
      const ProjectedVertex* const s = q;
      q = r, r = s;
      area = -area;
    }
    t.face = face;
    t.shade = shade_of(job, face, turned);
    t.origin_x = static_cast<float>(p.x);
    t.origin_y = static_cast<float>(p.y);
    // What rounding the origin moved, in each edge function.
    const double ox = p.x - double{t.origin_x};
    const double oy = p.y - double{t.origin_y};
    const double moved_q = qy * ox - qx * oy;
    const double moved_r = rx * oy - ry * ox;
    t.a[0] = static_cast<float>(-qy);
    t.b[0] = static_cast<float>(qx);
    t.c[0] = static_cast<float>(moved_q);
    t.a[1] = static_cast<float>(ry);
    t.b[1] = static_cast<float>(-rx);
    t.c[1] = static_cast<float>(moved_r);
    t.a[2] = static_cast<float>(qy - ry);
    t.b[2] = static_cast<float>(rx - qx);
    t.c[2] = static_cast<float>(area - moved_q - moved_r);
    const float span_x = static_cast<float>(absolute(qx) + absolute(rx));
    const float span_y = static_cast<float>(absolute(qy) + absolute(ry));
    t.epsilon = kTermError * (span_y * job.reach_x + span_x * job.reach_y + 4 * span_x * span_y) +
                kRayError * job.largest_ray * (span_x + span_y);
    const float over = static_cast<float>(1 / area);
    const float zq = q->inverse_z - p.inverse_z;
    const float zr = r->inverse_z - p.inverse_z;
    t.slope_x = (zq * static_cast<float>(ry) - zr * static_cast<float>(qy)) * over;
    t.slope_y = (zr * static_cast<float>(qx) - zq * static_cast<float>(rx)) * over;
    t.inverse_z =
        p.inverse_z - t.slope_x * static_cast<float>(ox) - t.slope_y * static_cast<float>(oy);
    t.min_inverse_z = smaller(smaller(p.inverse_z, q->inverse_z), r->inverse_z);
    t.max_inverse_z = larger(larger(p.inverse_z, q->inverse_z), r->inverse_z);
    draw_rows<false, false>(job.target, t, box.x0, box.y0, box.x1, box.y1);
  }
}

constexpr Kernels kKernels{project, cull, draw, rows, rows_near};

}  // namespace
}  // namespace sightline::raster
