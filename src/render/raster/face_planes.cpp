// SPDX-License-Identifier: Apache-2.0
#include "render/raster/face_planes.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "sightline/render/raster/backend.hpp"

namespace sightline {
namespace {

bool inside_edge(const Eigen::Vector3d& edge, const Eigen::Vector2d& ray) {
  const double e = edge.x() * ray.x() + edge.y() * ray.y() + edge.z();
  if (e != 0) return e > 0;
  return edge.x() > 0 || (edge.x() == 0 && edge.y() > 0);
}

/// Largest value of a linear function over the rays of a block, and of its terms.
double largest_over(const Eigen::Vector3d& f, const RayTable::RayBounds& b) {
  return f.x() * double{f.x() > 0 ? b.max_x : b.min_x} +
         f.y() * double{f.y() > 0 ? b.max_y : b.min_y} + f.z();
}
double scale_over(const Eigen::Vector3d& f, const RayTable::RayBounds& b) {
  return std::abs(f.x()) * double{std::max(std::abs(b.min_x), std::abs(b.max_x))} +
         std::abs(f.y()) * double{std::max(std::abs(b.min_y), std::abs(b.max_y))} + std::abs(f.z());
}

/// The near plane as one more edge function: 1 / kNearPlane - 1 / z.
Eigen::Vector3d near_edge(const Eigen::Vector3d& slope) {
  return Eigen::Vector3d(0, 0, 1 / kNearPlane) - slope;
}

}  // namespace

FacePlanes make_face_planes(const RenderMesh& mesh, const Eigen::Matrix3d& rotation,
                            const Eigen::Vector3d& translation, uint32_t face) {
  FacePlanes f;
  for (size_t k = 0; k < 3; ++k)
    f.corner[k] = rotation * mesh.vertex(mesh.faces[face][k]) + translation;
  // A shared edge gives exactly opposite numbers in its two faces, which the tie rule relies on.
  for (size_t k = 0; k < 3; ++k) f.edge[k] = f.corner[k].cross(f.corner[(k + 1) % 3]);
  const double volume = f.corner[2].dot(f.edge[0]);
  f.turned = volume > 0;
  f.valid = volume != 0 && std::isfinite(volume);
  if (!f.valid) return f;
  f.slope = (f.edge[0] + f.edge[1] + f.edge[2]) / volume;
  if (volume < 0) {
    for (Eigen::Vector3d& e : f.edge) e = -e;
  }
  return f;
}

bool FacePlanes::hit_by(const Eigen::Vector2d& ray) const {
  for (const Eigen::Vector3d& e : edge) {
    if (!inside_edge(e, ray)) return false;
  }
  return kNearPlane * (slope.x() * ray.x() + slope.y() * ray.y() + slope.z()) <= 1;
}

bool FacePlanes::misses(const RayTable::RayBounds& block, bool near) const {
  if (block.empty()) return true;
  const auto outside = [&](const Eigen::Vector3d& f) {
    return largest_over(f, block) < -1e-6 * scale_over(f, block);
  };
  return outside(edge[0]) || outside(edge[1]) || outside(edge[2]) ||
         (near && outside(near_edge(slope)));
}

raster::Triangle make_triangle(const FacePlanes& planes, const RayTable::RayBounds& rays,
                               bool near) {
  raster::Triangle t{};
  t.origin_x = 0.5f * (rays.min_x + rays.max_x);
  t.origin_y = 0.5f * (rays.min_y + rays.max_y);
  const double reach_x = double{rays.max_x} - double{rays.min_x};
  const double reach_y = double{rays.max_y} - double{rays.min_y};
  const double largest = std::max(std::max(std::abs(rays.min_x), std::abs(rays.max_x)),
                                  std::max(std::abs(rays.min_y), std::abs(rays.max_y)));
  const auto at_origin = [&](const Eigen::Vector3d& f) {
    return f.x() * double{t.origin_x} + f.y() * double{t.origin_y} + f.z();
  };
  const auto put = [&](size_t k, const Eigen::Vector3d& f) {
    const double value = at_origin(f);
    const double steep = std::abs(f.x()) + std::abs(f.y());
    const double error =
        double{raster::kTermError} *
            (std::abs(f.x()) * reach_x + std::abs(f.y()) * reach_y + std::abs(value)) +
        double{raster::kRayError} * largest * steep;
    const double scale = error > 0 ? 1 / error : 0;
    t.a[k] = static_cast<float>(f.x() * scale);
    t.b[k] = static_cast<float>(f.y() * scale);
    t.c[k] = static_cast<float>(value * scale);
  };
  for (size_t k = 0; k < 3; ++k) put(k, planes.edge[k]);
  if (near) put(3, near_edge(planes.slope));
  t.epsilon = 1;
  t.slope_x = static_cast<float>(planes.slope.x());
  t.slope_y = static_cast<float>(planes.slope.y());
  t.inverse_z = static_cast<float>(at_origin(planes.slope));
  t.min_inverse_z = std::numeric_limits<float>::max();
  t.max_inverse_z = near ? static_cast<float>(1 / kNearPlane) : 0.0f;
  for (const Eigen::Vector3d& corner : planes.corner) {
    if (corner.z() < kNearPlane) continue;
    const float inverse = static_cast<float>(1 / corner.z());
    t.min_inverse_z = std::min(t.min_inverse_z, inverse);
    t.max_inverse_z = std::max(t.max_inverse_z, inverse);
  }
  return t;
}

}  // namespace sightline
