// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/mesh_creases.hpp"

#include <algorithm>
#include <cmath>

#include "sightline/geometry/mesh_edges.hpp"

namespace sightline::observe {
namespace {

void append_edge(const TriangleMesh& mesh, const MeshEdge& edge, double spacing,
                 std::vector<CreasePoint>& out) {
  const Eigen::Vector3f& start = mesh.vertices[edge.start];
  const Eigen::Vector3f way = mesh.vertices[edge.end] - start;
  const float length = way.norm();
  if (!(length > 0)) return;
  const int points = static_cast<int>(std::min(1e5, std::ceil(double{length} / spacing)));
  for (int i = 0; i < points; ++i) {
    const float s = (static_cast<float>(i) + 0.5f) / static_cast<float>(points);
    out.push_back({start + s * way, edge.tangent});
  }
}

}  // namespace

std::vector<CreasePoint> crease_points(const TriangleMesh& mesh, double crease_angle,
                                       double spacing) {
  std::vector<CreasePoint> out;
  for (const MeshEdge& edge : feature_edges(mesh, crease_angle))
    append_edge(mesh, edge, spacing, out);
  return out;
}

}  // namespace sightline::observe
