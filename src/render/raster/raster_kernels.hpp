// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

// The inner loops of the CPU rasterizer, compiled for plain lanes, vectors and AVX2. Only plain
// structs cross this border: an inline function of a library compiled with AVX2 could otherwise be
// picked by the linker for processors that lack it.

namespace sightline::raster {

/// A vertex in ray space: x/z, y/z, 1/z, and its pixel relative to the tile (for boxes only).
struct ProjectedVertex {
  double x, y;
  float inverse_z;
  float u, v;
  uint32_t flags;
};
inline constexpr uint32_t kBehind = 1;  ///< z below the near plane; x, y, u, v mean nothing
inline constexpr uint32_t kBeyond = 2;  ///< outside the lens's usable radius; u, v mean nothing

struct ProjectJob {
  const float *x, *y, *z;  ///< object frame
  size_t count;
  double rotation[9], translation[3];  ///< camera_from_object, row-major
  double near_z;
  float max_radius_squared;
  const float *value, *step;  ///< RayTable::RadialLookup
  float scale, last_cell;
  float p1, p2, fx, fy, cx, cy;  ///< cx, cy relative to the tile
  ProjectedVertex* out;
};

struct CullJob {
  const float *normal_x, *normal_y, *normal_z, *offset;
  size_t count;
  float eye_x, eye_y, eye_z;  ///< camera center in the object frame
  float tolerance;            ///< faces seen from behind by more than this are dropped [m]
  uint32_t* out;              ///< room for `count`
};

/// Where to draw: the tile's planes and the rays under it.
struct Target {
  float* depth;
  uint8_t* shade;
  size_t stride;
  uint32_t* face;              ///< used by the kernels that number faces only
  const float *ray_x, *ray_y;  ///< at the tile's corner
  size_t ray_stride;
  int width, height;
};

/// Answers, in double precision, whether the ray of a tile pixel hits a face.
using Decide = bool (*)(void* context, uint32_t face, int x, int y);

/// A triangle ready for its pixels. Inside: a[k] dx + b[k] dy + c[k] > 0 for all k, with dx, dy the
/// ray relative to the origin; within +-epsilon of zero only `decide` knows.
struct Triangle {
  float origin_x, origin_y;
  float a[4], b[4], c[4];  ///< the fourth is the near plane, used by rows_near only
  float epsilon;
  float inverse_z, slope_x, slope_y;  ///< 1/z = inverse_z + slope_x dx + slope_y dy
  float min_inverse_z, max_inverse_z;
  uint8_t shade;
  uint32_t face;
  Decide decide;
  void* context;
};

struct DrawJob {
  Target target;
  const ProjectedVertex* vertices;
  const uint32_t (*faces)[3];
  const uint32_t* list;  ///< faces to draw
  size_t count;
  const float *normal_x, *normal_y, *normal_z, *luminance;
  float light_x, light_y, light_z;  ///< towards the light, object frame
  float ambient;
  bool cull;
  float box_margin;        ///< [px]
  float bulge;             ///< [px] per squared ray length, worst over the lens
  float reach_x, reach_y;  ///< extent of the tile's rays
  float largest_ray;       ///< bound of |x/z|, |y/z| over the tile
  Decide decide;
  void* context;
  uint32_t* deferred;  ///< out: faces that need the careful path; room for `count`
  size_t deferred_count;
};

/// What fills pixels: with the face's shade, or with its number.
struct PixelKernels {
  void (*draw)(DrawJob& job);
  /// Draws the pixels of `triangle` inside x0..x1, y0..y1 (tile pixels, inclusive).
  void (*rows)(const Target& target, const Triangle& triangle, int x0, int y0, int x1, int y1);
  void (*rows_near)(const Target& target, const Triangle& triangle, int x0, int y0, int x1, int y1);
};

struct Kernels {
  void (*project)(const ProjectJob& job);
  size_t (*cull)(const CullJob& job);
  PixelKernels shades, faces;
};

const Kernels& scalar_kernels();
/// By the vectors that each processor of the target has.
const Kernels& vector_kernels();
/// Null if this build has none.
const Kernels* avx2_kernels();

/// Rounding of float edge functions in units of their largest terms: five roundings of 2^-24 each
/// in coefficient, ray offset, product and two sums; and one in the stored rays.
inline constexpr float kTermError = 0x1.4p-22f;
inline constexpr float kRayError = 0x1.2p-24f;

/// Bounding boxes larger than this [px] take the careful path, which skips empty blocks.
inline constexpr int kSmallBox = 48;

}  // namespace sightline::raster
