// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "sightline/render/raster/backend.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline::test {

/// What a brute-force, double-precision ray cast sees at one pixel.
struct CastHit {
  double inverse_z = 0;  ///< 0: nothing
  int shade = 0;
  uint32_t face = 0;
  double second_inverse_z = 0;  ///< of the next surface behind the nearest one
};

/// Independent of the rasterizer: rays from CameraModel::unproject, every face tried by
/// Moller-Trumbore, nearest hit wins. Follows the renderer's rules: back faces of closed meshes and
/// surfaces before the near plane are not there.
class RayCaster {
 public:
  RayCaster(const RenderMesh& mesh, const Rigid3& camera_from_object)
      : mesh_(mesh), rotation_(camera_from_object.rotation_matrix()) {
    for (uint32_t i = 0; i < mesh.vertex_count(); ++i)
      points_.push_back(rotation_ * mesh.vertex(i) + camera_from_object.translation);
    for (const auto& face : mesh.faces) limits_.push_back(limits(face));
  }

  CastHit cast(const Eigen::Vector3d& ray) const {
    CastHit hit;
    const Eigen::Vector3d r = ray / ray.z();
    for (uint32_t f = 0; f < mesh_.faces.size(); ++f) {
      const Limits& l = limits_[f];
      if (r.x() < l.low_x || r.x() > l.high_x || r.y() < l.low_y || r.y() > l.high_y) continue;
      const auto z = depth(f, r);
      if (!z || *z < kNearPlane) continue;
      const double inverse = 1 / *z;
      if (inverse > hit.inverse_z) {
        hit.second_inverse_z = hit.inverse_z;
        hit.inverse_z = inverse;
        hit.face = f;
      } else {
        hit.second_inverse_z = std::max(hit.second_inverse_z, inverse);
      }
    }
    if (hit.inverse_z > 0) hit.shade = shade(hit.face, r);
    return hit;
  }

 private:
  /// Rectangle of rays that a face in front of the camera lies in, to save time.
  struct Limits {
    double low_x = -kEverywhere, high_x = kEverywhere, low_y = -kEverywhere, high_y = kEverywhere;
  };
  static constexpr double kEverywhere = std::numeric_limits<double>::infinity();

  Limits limits(const std::array<uint32_t, 3>& face) const {
    Limits l{kEverywhere, -kEverywhere, kEverywhere, -kEverywhere};
    for (const uint32_t v : face) {
      const Eigen::Vector3d& p = points_[v];
      if (p.z() <= 0) return {};
      const double x = p.x() / p.z();
      const double y = p.y() / p.z();
      const double slack = 1e-9 * (1 + std::abs(x) + std::abs(y));
      l = {std::min(l.low_x, x - slack), std::max(l.high_x, x + slack),
           std::min(l.low_y, y - slack), std::max(l.high_y, y + slack)};
    }
    return l;
  }

  std::optional<double> depth(uint32_t face, const Eigen::Vector3d& r) const {
    const auto& f = mesh_.faces[face];
    const Eigen::Vector3d& p = points_[f[0]];
    const Eigen::Vector3d e1 = points_[f[1]] - p;
    const Eigen::Vector3d e2 = points_[f[2]] - p;
    const Eigen::Vector3d h = r.cross(e2);
    const double a = e1.dot(h);  // negative where the back is seen
    if (a == 0 || (a < 0 && mesh_.cull_back_faces)) return std::nullopt;
    const double u = -p.dot(h) / a;
    const Eigen::Vector3d q = -p.cross(e1);
    const double v = r.dot(q) / a;
    if (u < 0 || v < 0 || u + v > 1) return std::nullopt;
    const double t = e2.dot(q) / a;
    if (!(t > 0)) return std::nullopt;
    return t;  // r.z() is 1
  }

  int shade(uint32_t face, const Eigen::Vector3d& r) const {
    const auto& f = mesh_.faces[face];
    Eigen::Vector3d n = (points_[f[1]] - points_[f[0]]).cross(points_[f[2]] - points_[f[0]]);
    n.normalize();
    if (n.dot(r) > 0) n = -n;
    const double lambert = std::max(0.0, n.dot(Eigen::Vector3d(kLightX, kLightY, kLightZ)));
    const double level = kAmbient + (1 - kAmbient) * lambert;
    return static_cast<int>(std::floor(255 * level * double{mesh_.luminance[face]} + 0.5));
  }

  const RenderMesh& mesh_;
  Eigen::Matrix3d rotation_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Limits> limits_;
};

}  // namespace sightline::test
