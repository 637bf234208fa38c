// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/egl_shaders.hpp"

#include <fmt/format.h>

#include "render/raster/raster_kernels.hpp"
#include "sightline/render/raster/backend.hpp"

// Rays are counted from `center`, the ray of the tile's middle: that keeps float precise. Seen from
// there, space is sheared (x - center.x z, y - center.y z, z), which leaves volumes alone.

namespace sightline::egl {
namespace {

std::string header() {
  return fmt::format(
      "#version 310 es\n"
      "precision highp float;\n"
      "precision highp int;\n"
      "precision highp sampler2D;\n"
      "precision highp usampler2D;\n"
      "const uint kBehind = {}u;\n"
      "const uint kBeyond = {}u;\n"
      "const float kNear = {:.9e};\n"
      "ivec2 entry(uint i) {{ return ivec2(int(i % {}u), int(i / {}u)); }}\n",
      raster::kBehind, raster::kBeyond, kNearPlane, kTableWidth, kTableWidth);
}

constexpr const char* kFullScreenVertex = R"(
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
)";

constexpr const char* kProjectFragment = R"(
uniform sampler2D vertices;     // x, y, z in the object's frame
uniform sampler2D lens;         // radial factor: value, step
uniform mat3 rotation;
uniform vec3 translation;       // sheared
uniform vec2 center;
uniform vec4 lens_shape;        // cells per unit, last cell, p1, p2
uniform vec4 focal;             // fx, fy, cx, cy; cx, cy from the tile's corner
uniform float max_radius_squared;
layout(location = 0) out uvec4 vertex_out;  // ray x, y, 1/z, flags; behind: x, y, z, flags
layout(location = 1) out uvec2 pixel_out;

void main() {
  vec3 turned = rotation * texelFetch(vertices, ivec2(gl_FragCoord.xy), 0).xyz;
  vec3 p = vec3(turned.xy - center * turned.z, turned.z) + translation;
  if (p.z < kNear) {
    vertex_out = uvec4(floatBitsToUint(p), kBehind);
    pixel_out = uvec2(0u);
    return;
  }
  vec2 ray = p.xy / p.z;
  vec2 m = ray + center;
  float r2 = dot(m, m);
  float s = min((1.0 - inversesqrt(1.0 + r2)) * lens_shape.x, lens_shape.y);
  vec2 cell = texelFetch(lens, ivec2(int(s), 0), 0).xy;
  float factor = cell.x + (s - floor(s)) * cell.y;
  float xy = 2.0 * m.x * m.y;
  vec2 tangential = vec2(lens_shape.z * xy + lens_shape.w * (r2 + 2.0 * m.x * m.x),
                         lens_shape.z * (r2 + 2.0 * m.y * m.y) + lens_shape.w * xy);
  vec2 pixel = focal.xy * (m * factor + tangential) + focal.zw;
  uint flags = r2 <= max_radius_squared ? 0u : kBeyond;
  vertex_out = uvec4(floatBitsToUint(vec3(ray, 1.0 / p.z)), flags);
  pixel_out = floatBitsToUint(pixel);
}
)";

constexpr const char* kFaceVertex = R"(
uniform usampler2D faces;       // three vertices
uniform sampler2D normals;      // normal, luminance
uniform usampler2D vertices;
uniform usampler2D pixels;
uniform vec2 tile_size;
uniform vec4 ray_bounds;        // of the tile: least x, most x, least y, most y
uniform vec3 light;             // object's frame
uniform float ambient;
uniform vec2 growth;            // of boxes: pixels, and pixels per squared ray length
uniform bool cull;
uniform bool number_faces;      // instead of shading them
flat out vec3 edge0;            // inside: edge.x dx + edge.y dy + edge.z > 0
flat out vec3 edge1;
flat out vec3 edge2;
flat out vec3 depth;            // 1/z = depth.x dx + depth.y dy + depth.z
flat out vec4 origin_range;     // dx, dy are counted from here; least and most 1/z
flat out vec3 constant_scale;   // size of the terms that the edges' constants were summed from
flat out uvec2 paint;           // shade or number, may be cut by the near plane

struct Corner { vec3 p; uint flags; vec2 pixel; };

Corner corner(uint i) {
  uvec4 v = texelFetch(vertices, entry(i), 0);
  return Corner(uintBitsToFloat(v.xyz), v.w, uintBitsToFloat(texelFetch(pixels, entry(i), 0).xy));
}

vec3 in_space(Corner c) {
  return (c.flags & kBehind) != 0u ? c.p : vec3(c.p.xy, 1.0) / c.p.z;
}

vec3 cross_scale(vec3 a, vec3 b) { return abs(a.yzx * b.zxy) + abs(a.zxy * b.yzx); }

// Edge functions of a face in front of the camera, from its first corner. False: nothing to draw.
bool set_up(vec3 p, vec3 q, vec3 r, out bool turned) {
  vec2 pq = q.xy - p.xy;
  vec2 pr = r.xy - p.xy;
  float area = pq.x * pr.y - pq.y * pr.x;
  turned = area > 0.0;
  float side = turned ? 1.0 : -1.0;
  edge0 = side * vec3(-pq.y, pq.x, 0.0);
  edge1 = side * vec3(pr.y, -pr.x, 0.0);
  edge2 = vec3(side * (pq.y - pr.y), side * (pr.x - pq.x), abs(area));
  constant_scale = vec3(0.0, 0.0, abs(pq.x * pr.y) + abs(pq.y * pr.x));
  float over = 1.0 / abs(area);
  depth = vec3(((q.z - p.z) * edge1.xy + (r.z - p.z) * edge0.xy) * over, p.z);
  origin_range = vec4(p.xy, min(min(p.z, q.z), r.z), max(max(p.z, q.z), r.z));
  return area != 0.0;
}

// The same for a face that the near plane may cut (Olano and Greer 1997), from the middle ray.
bool set_up_near(vec3 p, vec3 q, vec3 r, out bool turned) {
  edge0 = cross(p, q);
  edge1 = cross(q, r);
  edge2 = cross(r, p);
  float volume = dot(r, edge0);
  turned = volume > 0.0;
  depth = (edge0 + edge1 + edge2) / volume;
  if (!turned) {
    edge0 = -edge0;
    edge1 = -edge1;
    edge2 = -edge2;
  }
  constant_scale = vec3(cross_scale(p, q).z, cross_scale(q, r).z, cross_scale(r, p).z);
  origin_range = vec4(0.0, 0.0, 0.0, 1.0 / kNear);
  return volume != 0.0;
}

void main() {
  uint face = uint(gl_VertexID) / 6u;
  uint which = uint(gl_VertexID) % 6u;
  gl_Position = vec4(2.0, 2.0, 0.0, 1.0);  // outside: nothing is drawn
  uvec3 f = texelFetch(faces, entry(face), 0).xyz;
  Corner a = corner(f.x);
  Corner b = corner(f.y);
  Corner c = corner(f.z);
  uint flags = a.flags | b.flags | c.flags;
  bool near = (flags & kBehind) != 0u;
  if ((a.flags & b.flags & c.flags & kBehind) != 0u) return;
  vec2 low = vec2(0.0);
  vec2 high = tile_size;
  if (!near) {
    vec2 least = min(min(a.p.xy, b.p.xy), c.p.xy);
    vec2 most = max(max(a.p.xy, b.p.xy), c.p.xy);
    if (any(greaterThan(least, ray_bounds.yw)) || any(lessThan(most, ray_bounds.xz))) return;
    if (flags == 0u) {
      vec2 pq = b.p.xy - a.p.xy;
      vec2 pr = c.p.xy - a.p.xy;
      float grow = growth.x + growth.y * (dot(pq, pq) + dot(pr, pr));
      low = clamp(ceil(min(min(a.pixel, b.pixel), c.pixel) - grow), vec2(0.0), tile_size);
      high = clamp(floor(max(max(a.pixel, b.pixel), c.pixel) + grow) + 1.0, vec2(0.0), tile_size);
      if (any(greaterThanEqual(low, high))) return;
    }
  }
  // A corner far from the tile, beside the camera, is known in space but not as a ray.
  vec2 far = max(max(abs(a.p.xy), abs(b.p.xy)), abs(c.p.xy));
  bool turned;
  bool in_space_only = near || max(far.x, far.y) > 2.0;
  bool shown = in_space_only ? set_up_near(in_space(a), in_space(b), in_space(c), turned)
                    : set_up(a.p, b.p, c.p, turned);
  if (!shown || (turned && cull)) return;
  paint = uvec2(face, in_space_only ? 1u : 0u);
  if (!number_faces) {
    vec4 normal = texelFetch(normals, entry(face), 0);
    float lambert = max((turned ? -1.0 : 1.0) * dot(normal.xyz, light), 0.0);
    paint.x = uint(255.0 * (ambient + (1.0 - ambient) * lambert) * normal.w + 0.5);
  }
  vec2 at = vec2((which == 1u || which == 4u || which == 5u) ? high.x : low.x,
                 (which == 2u || which == 3u || which == 5u) ? high.y : low.y);
  gl_Position = vec4(2.0 * at / tile_size - 1.0, 0.0, 1.0);
}
)";

constexpr const char* kFaceFragment = R"(
uniform sampler2D rays;         // of the frame; 1e30 where there is none
uniform ivec2 tile_corner;
uniform vec2 center;
flat in vec3 edge0;
flat in vec3 edge1;
flat in vec3 edge2;
flat in vec3 depth;
flat in vec4 origin_range;
flat in vec3 constant_scale;
flat in uvec2 paint;
layout(location = 0) out uvec2 result;  // 1/z, paint

// Positive inside. What rounding may take away is given back, so that no ray falls between two
// faces.
bool inside(vec3 edge, float scale, vec2 d) {
  vec2 terms = edge.xy * d;
  float slack = 0x1p-22 * (abs(terms.x) + abs(terms.y) + scale);
  return terms.x + terms.y + edge.z > -slack;
}

void main() {
  vec2 ray = texelFetch(rays, ivec2(gl_FragCoord.xy) + tile_corner, 0).xy;
  if (ray.x > 1e29) discard;
  vec2 d = (ray - center) - origin_range.xy;
  if (!(inside(edge0, constant_scale.x, d) && inside(edge1, constant_scale.y, d) &&
        inside(edge2, constant_scale.z, d)))
    discard;
  float inverse_z = dot(depth.xy, d) + depth.z;
  if (paint.y != 0u) {
    if (!(inverse_z > 0.0 && inverse_z <= origin_range.w)) discard;
  } else {
    inverse_z = clamp(inverse_z, origin_range.z, origin_range.w);
  }
  gl_FragDepth = inverse_z * 0x1p-10;  // below one: the near plane is at 1/z = 1000
  result = uvec2(floatBitsToUint(inverse_z), paint.x);
}
)";

/// GLSL has no hexadecimal floats.
std::string with_powers(std::string source) {
  for (const auto& [name, value] : {std::pair{"0x1p-22", 0x1p-22}, std::pair{"0x1p-10", 0x1p-10}}) {
    for (size_t at; (at = source.find(name)) != std::string::npos;)
      source.replace(at, std::string(name).size(), fmt::format("{:.12e}", value));
  }
  return source;
}

}  // namespace

std::string full_screen_vertex_source() { return header() + kFullScreenVertex; }
std::string project_fragment_source() { return header() + kProjectFragment; }
std::string face_vertex_source() { return header() + kFaceVertex; }
std::string face_fragment_source() { return header() + with_powers(kFaceFragment); }

}  // namespace sightline::egl
