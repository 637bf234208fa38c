// SPDX-License-Identifier: Apache-2.0
// Vertices through the lens, and which faces look towards the camera; part of raster_loops.inl.

namespace sightline::raster {
namespace {

inline double absolute(double a) { return a < 0 ? -a : a; }
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

constexpr size_t kChunk = 64;

/// Vertices in chunks of plain arrays, so that the compiler vectorizes each step.
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

}  // namespace
}  // namespace sightline::raster
