// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/mesh_creases.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <tuple>

namespace sightline::observe {
namespace {

struct HalfEdge {
  uint32_t low, high, face;
};

// For each vertex the first one at the same place: files split vertices at creases and seams.
std::vector<uint32_t> joined_vertices(const std::vector<Eigen::Vector3f>& points) {
  std::vector<uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto key = [&](uint32_t i) {
    return std::tuple(points[i].x(), points[i].y(), points[i].z());
  };
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return std::tuple(key(a), a) < std::tuple(key(b), b); });
  std::vector<uint32_t> joined(points.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && key(order[i]) == key(order[i - 1]);
    joined[order[i]] = same ? joined[order[i - 1]] : order[i];
  }
  return joined;
}

std::vector<HalfEdge> half_edges(const TriangleMesh& mesh) {
  const std::vector<uint32_t> joined = joined_vertices(mesh.vertices);
  std::vector<HalfEdge> edges;
  edges.reserve(mesh.faces.size() * 3);
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = joined[mesh.faces[f][k]];
      const uint32_t b = joined[mesh.faces[f][(k + 1) % 3]];
      if (a != b) edges.push_back({std::min(a, b), std::max(a, b), f});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.face) < std::tie(b.low, b.high, b.face);
  });
  return edges;
}

std::vector<Eigen::Vector3f> face_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3f> normals;
  normals.reserve(mesh.faces.size());
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3f& p = mesh.vertices[face[0]];
    normals.push_back((mesh.vertices[face[1]] - p).cross(mesh.vertices[face[2]] - p).normalized());
  }
  return normals;
}

void append_edge(const Eigen::Vector3f& start, const Eigen::Vector3f& end, double spacing,
                 std::vector<CreasePoint>& out) {
  const Eigen::Vector3f along = end - start;
  const float length = along.norm();
  if (!(length > 0)) return;
  const int points = static_cast<int>(std::min(1e5, std::ceil(double{length} / spacing)));
  for (int i = 0; i < points; ++i) {
    const float s = (static_cast<float>(i) + 0.5f) / static_cast<float>(points);
    out.push_back({start + s * along, along / length});
  }
}

}  // namespace

std::vector<CreasePoint> crease_points(const TriangleMesh& mesh, double crease_angle,
                                       double spacing) {
  const std::vector<HalfEdge> edges = half_edges(mesh);
  const std::vector<Eigen::Vector3f> normals = face_normals(mesh);
  const auto min_cosine = static_cast<float>(std::cos(crease_angle));
  std::vector<CreasePoint> out;
  for (size_t i = 0; i < edges.size();) {
    size_t end = i + 1;
    while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high)
      ++end;
    const bool pair = end - i == 2;
    const bool smooth =
        pair && normals[edges[i].face].dot(normals[edges[i + 1].face]) >= min_cosine;
    if (!smooth) {
      append_edge(mesh.vertices[edges[i].low], mesh.vertices[edges[i].high], spacing, out);
    }
    i = end;
  }
  return out;
}

}  // namespace sightline::observe
