// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "sightline/geometry/mesh.hpp"

namespace sightline {

/// Where a mesh's surface is nearest to a point.
struct SurfacePoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the surface, mesh frame [m]
  uint32_t face = 0;
  double distance = 0;  ///< [m], not signed
};

/// The point of a mesh nearest to any point in space, through a tree of boxes: microseconds for
/// 100k faces near the surface. Immutable once made; any thread.
class MeshDistance {
 public:
  explicit MeshDistance(const TriangleMesh& mesh);
  SurfacePoint nearest(const Eigen::Vector3d& point) const;

 private:
  struct Box {
    Eigen::Array3d low = Eigen::Array3d::Constant(1e300);
    Eigen::Array3d high = Eigen::Array3d::Constant(-1e300);
    double squared_distance(const Eigen::Vector3d& point) const;
  };
  struct Node {
    Box box;
    uint32_t first = 0;  ///< leaf: into faces_; else the second child (the first follows the node)
    uint32_t count = 0;  ///< 0: inner node
  };
  struct Face {
    Eigen::Vector3d a, b, c;
    uint32_t index;
  };
  void build(size_t first, size_t count);

  std::vector<Node> nodes_;
  std::vector<Face> faces_;
};

/// The point of a triangle nearest to `p` (Ericson, Real-Time Collision Detection, section 5.1.5).
Eigen::Vector3d nearest_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                    const Eigen::Vector3d& b, const Eigen::Vector3d& c);

}  // namespace sightline
