// SPDX-License-Identifier: Apache-2.0
#include "hidden_surfaces/exact.hpp"

#include <cmath>

#include "hidden_surfaces/ray_triangle.hpp"

#ifdef SIGHTLINE_HAS_EMBREE
#include <embree3/rtcore.h>
#endif

namespace sightline::hidden_surfaces {
namespace {

// On an edge between two owners both are seen.
bool as_near(const Scene& scene, int32_t face, int32_t nearest, const Eigen::Vector3d& ray) {
  constexpr double kSame = 1e-12;
  const auto a = hit_distance(scene.faces[static_cast<size_t>(face)], ray);
  const auto b = hit_distance(scene.faces[static_cast<size_t>(nearest)], ray);
  return a && b && std::abs(*a - *b) <= kSame * *b;
}

}  // namespace

#ifdef SIGHTLINE_HAS_EMBREE

bool exact_has_embree() { return true; }

Picture exact_picture(const Scene& scene) {
  Picture picture(scene.tile());
  const RTCDevice device = rtcNewDevice("threads=1");
  const RTCScene tree = rtcNewScene(device);
  rtcSetSceneFlags(tree, RTC_SCENE_FLAG_ROBUST);
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const size_t faces = scene.faces.size();
  auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                             RTC_FORMAT_FLOAT3, 12, 3 * faces));
  auto* corners = static_cast<uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, faces));
  for (size_t i = 0; i < 3 * faces; ++i) {
    const Eigen::Vector3f corner = scene.faces[i / 3].corner[i % 3].cast<float>();
    for (Eigen::Index k = 0; k < 3; ++k) points[3 * i + static_cast<size_t>(k)] = corner[k];
    corners[i] = static_cast<uint32_t>(i);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(tree, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(tree);
  const Tile& tile = picture.tile;
  for (int y = tile.y; y < tile.y + tile.height; ++y) {
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      const Eigen::Vector3f ray = scene.view.ray(x, y).cast<float>();
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      RTCRayHit hit{};
      hit.ray.dir_x = ray.x();
      hit.ray.dir_y = ray.y();
      hit.ray.dir_z = ray.z();
      hit.ray.tfar = std::numeric_limits<float>::infinity();
      hit.ray.mask = ~0u;
      hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(tree, &context, &hit);
      if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
      picture.at(x, y) = static_cast<int32_t>(hit.hit.primID);
    }
  }
  rtcReleaseScene(tree);
  rtcReleaseDevice(device);
  return picture;
}

#else

bool exact_has_embree() { return false; }

Picture exact_picture(const Scene& scene) {
  Picture picture(scene.tile());
  const Tile& tile = picture.tile;
  for (int y = tile.y; y < tile.y + tile.height; ++y) {
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      picture.at(x, y) = nearest_face(scene, x, y);
    }
  }
  return picture;
}

#endif

int owner_at(const Scene& scene, const Picture& picture, int x, int y) {
  const int32_t face = picture.at(x, y);
  return face < 0 ? -1 : scene.faces[static_cast<size_t>(face)].owner;
}

size_t wrong_pixels(const Scene& scene, const Picture& drawn, Picture& exact,
                    const std::function<void(int, int)>& mark) {
  size_t wrong = 0;
  const Tile& tile = drawn.tile;
  for (int y = tile.y; y < tile.y + tile.height; ++y) {
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      if (owner_at(scene, drawn, x, y) == owner_at(scene, exact, x, y)) continue;
      exact.at(x, y) = nearest_face(scene, x, y);
      if (owner_at(scene, drawn, x, y) == owner_at(scene, exact, x, y)) continue;
      const int32_t a = drawn.at(x, y), b = exact.at(x, y);
      if (a >= 0 && b >= 0 && as_near(scene, a, b, scene.view.ray(x, y))) continue;
      ++wrong;
      if (mark) mark(x, y);
    }
  }
  return wrong;
}

}  // namespace sightline::hidden_surfaces
