// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <optional>

#include "hidden_surfaces/scene.hpp"

namespace sightline::hidden_surfaces {

/// Where a ray from the eye meets a face, in lengths of the ray (Möller and Trumbore, 1997). Edges
/// belong to both of their faces.
inline std::optional<double> hit_distance(const Face& face, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d u = face.corner[1] - face.corner[0], v = face.corner[2] - face.corner[0];
  const Eigen::Vector3d p = ray.cross(v);
  const double determinant = u.dot(p);
  if (determinant == 0) return std::nullopt;
  const Eigen::Vector3d from_corner = -face.corner[0];
  const double a = from_corner.dot(p) / determinant;
  if (a < 0 || a > 1) return std::nullopt;
  const Eigen::Vector3d q = from_corner.cross(u);
  const double b = ray.dot(q) / determinant;
  if (b < 0 || a + b > 1) return std::nullopt;
  return v.dot(q) / determinant;
}

}  // namespace sightline::hidden_surfaces
