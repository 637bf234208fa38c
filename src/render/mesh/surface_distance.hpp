// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// Answers how far points are from a mesh's surface, with a grid of cells that know their faces.
/// Reads the mesh while it lives.
class SurfaceDistance {
 public:
  explicit SurfaceDistance(const RenderMesh& mesh);
  /// [m]
  double operator()(const Eigen::Vector3d& point) const;

 private:
  using Cell = std::array<int, 3>;
  Cell cell_of(const Eigen::Vector3d& point) const;
  size_t index_of(const Cell& cell) const;
  double nearest_in(const Cell& cell, const Eigen::Vector3d& point) const;

  const RenderMesh& mesh_;
  Eigen::Vector3d low_;
  double cell_size_ = 1;
  Cell count_{};
  std::vector<std::vector<uint32_t>> cells_;
};

/// Distance of a point from a triangle (Ericson, "Real-Time Collision Detection", 5.1.5).
double distance_to_triangle(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                            const Eigen::Vector3d& b, const Eigen::Vector3d& c);

}  // namespace sightline
