// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>

#include "render/raster/raster_kernels.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline {

/// A face seen from the camera's center, in double precision. The edge functions of homogeneous
/// rasterization (Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates",
/// 1997) need no clipping: a ray (rx, ry, 1) hits the face in front of the camera exactly if its
/// product with all three edge planes is positive, wherever the corners are.
struct FacePlanes {
  std::array<Eigen::Vector3d, 3> corner;  ///< in the camera's frame
  std::array<Eigen::Vector3d, 3> edge;    ///< planes through the camera's center, turned inward
  Eigen::Vector3d slope;                  ///< 1 / z = slope . (rx, ry, 1)
  bool valid = false;                     ///< false for a face seen edge-on
  bool turned = false;                    ///< its back is seen

  /// Whether the ray hits the face at or beyond the near plane. A ray exactly on an edge that two
  /// faces share hits one of them.
  bool hit_by(const Eigen::Vector2d& ray) const;
  /// True if no ray of the block can hit.
  bool misses(const RayTable::RayBounds& block, bool near) const;
};

FacePlanes make_face_planes(const RenderMesh& mesh, const Eigen::Matrix3d& rotation,
                            const Eigen::Vector3d& translation, uint32_t face);

/// Float edge functions and depth relative to the middle of `rays`, for pixels within. Each edge
/// function is scaled so that its rounding bound is one. Shade, face and decide are left to set.
raster::Triangle make_triangle(const FacePlanes& planes, const RayTable::RayBounds& rays,
                               bool near);

}  // namespace sightline
