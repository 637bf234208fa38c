// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "sightline/geometry/mesh.hpp"

namespace sightline::test {

struct RayHit {
  float distance = 0;  ///< in lengths of the ray's direction
  uint32_t face = 0;
  Eigen::Vector3f point = Eigen::Vector3f::Zero();  ///< in the mesh's frame [m]
  Eigen::Vector3f normal =
      Eigen::Vector3f::Zero();  ///< unit, interpolated between the face's corners
};

/// A mesh that rays can be cast at, through a tree of boxes (split by the surface area heuristic:
/// MacDonald and Booth, 1990). Shares nothing with the product's rasterizer. Immutable.
class RayMesh {
 public:
  explicit RayMesh(TriangleMesh mesh);

  const TriangleMesh& mesh() const { return mesh_; }

  /// The nearest face from either side, at origin + distance * direction, 0 < distance < limit.
  std::optional<RayHit> cast(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                             float limit = 1e30f) const;
  /// Whether anything is hit before `limit`.
  bool blocked(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float limit) const {
    return cast(origin, direction, limit).has_value();
  }

 private:
  struct Box {
    Eigen::Array3f low = Eigen::Array3f::Constant(1e30f), high = Eigen::Array3f::Constant(-1e30f);
    void add(const Box& other) { low = low.min(other.low), high = high.max(other.high); }
    float area() const;
  };
  struct Node {
    Box box;
    uint32_t first = 0;  ///< leaf: into order_; else the second child (the first follows the node)
    uint32_t count = 0;  ///< 0: inner node
  };
  struct Triangle {
    Eigen::Vector3f corner, side_u, side_v;
  };
  struct Nearest {
    float distance;
    uint32_t triangle = 0;
    float u = 0, v = 0;
    bool found = false;
  };
  void build(uint32_t first, uint32_t count);
  uint32_t split(uint32_t first, uint32_t count, const Box& middles);
  void try_triangle(uint32_t index, const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                    Nearest& nearest) const;

  TriangleMesh mesh_;
  std::vector<Node> nodes_;
  std::vector<uint32_t> order_;      ///< faces
  std::vector<Triangle> triangles_;  ///< in that order
  std::vector<Box> boxes_;           ///< by face; only while building
};

}  // namespace sightline::test
