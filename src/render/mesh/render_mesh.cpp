// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/mesh/render_mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

#include "sightline/geometry/mesh_edges.hpp"

namespace sightline {
namespace {

constexpr uint32_t kNone = ~uint32_t{0};

/// For each vertex of the file, the joined vertex that stands for its position.
std::vector<uint32_t> join_vertices(const std::vector<Eigen::Vector3f>& points, RenderMesh& mesh) {
  std::vector<uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto less = [&](uint32_t a, uint32_t b) {
    const Eigen::Vector3f& p = points[a];
    const Eigen::Vector3f& q = points[b];
    if (p.x() != q.x()) return p.x() < q.x();
    if (p.y() != q.y()) return p.y() < q.y();
    if (p.z() != q.z()) return p.z() < q.z();
    return a < b;
  };
  std::sort(order.begin(), order.end(), less);
  std::vector<uint32_t> first(points.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && points[order[i]] == points[order[i - 1]];
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  // Numbered in the order of the file, which keeps neighbors close in memory.
  std::vector<uint32_t> joined(points.size());
  for (uint32_t i = 0; i < points.size(); ++i) {
    if (first[i] != i) continue;
    joined[i] = static_cast<uint32_t>(mesh.x.size());
    mesh.x.push_back(points[i].x());
    mesh.y.push_back(points[i].y());
    mesh.z.push_back(points[i].z());
  }
  for (uint32_t i = 0; i < points.size(); ++i) joined[i] = joined[first[i]];
  return joined;
}

float luminance_of(const TriangleMesh& mesh, size_t face) {
  if (mesh.face_colors.empty()) return 0.8f;
  const Eigen::Vector3f& c = mesh.face_colors[face];
  return std::clamp(0.299f * c.x() + 0.587f * c.y() + 0.114f * c.z(), 0.0f, 1.0f);
}

void add_face(const TriangleMesh& source, size_t face, const std::vector<uint32_t>& joined,
              RenderMesh& mesh) {
  const std::array<uint32_t, 3>& f = source.faces[face];
  const std::array<uint32_t, 3> corners = {joined[f[0]], joined[f[1]], joined[f[2]]};
  const Eigen::Vector3d p = mesh.vertex(corners[0]);
  const Eigen::Vector3d cross = (mesh.vertex(corners[1]) - p).cross(mesh.vertex(corners[2]) - p);
  const double length = cross.norm();
  if (!(length > 0)) return;
  const Eigen::Vector3d normal = cross / length;
  mesh.faces.push_back(corners);
  mesh.normal_x.push_back(static_cast<float>(normal.x()));
  mesh.normal_y.push_back(static_cast<float>(normal.y()));
  mesh.normal_z.push_back(static_cast<float>(normal.z()));
  mesh.offset.push_back(static_cast<float>(normal.dot(p)));
  mesh.luminance.push_back(luminance_of(source, face));
  if (!source.face_normals.empty()) mesh.face_corner_normals.push_back(source.face_normals[face]);
}

/// `prepared`: for each face of the file the one of the mesh; those without area have none.
void find_feature_edges(const TriangleMesh& source, const std::vector<uint32_t>& joined,
                        const std::vector<uint32_t>& prepared, RenderMesh& mesh) {
  for (const MeshEdge& edge : feature_edges(source, static_cast<double>(mesh.crease_angle))) {
    uint32_t first = prepared[edge.first_face], second = prepared[edge.second_face];
    if (first == kNone) first = second;
    if (second == kNone) second = first;
    if (first != kNone)
      mesh.feature_edges.push_back({joined[edge.start], joined[edge.end], first, second});
  }
}

}  // namespace

RenderMesh make_render_mesh(const TriangleMesh& source, const RenderMeshOptions& options) {
  static std::atomic<uint64_t> count{0};
  RenderMesh mesh;
  mesh.serial = ++count;
  const std::vector<uint32_t> joined = join_vertices(source.vertices, mesh);
  std::vector<uint32_t> prepared;
  for (size_t f = 0; f < source.faces.size(); ++f) {
    const auto next = static_cast<uint32_t>(mesh.faces.size());
    add_face(source, f, joined, mesh);
    prepared.push_back(mesh.faces.size() > next ? next : kNone);
  }
  mesh.corner_normals = source.normals;
  mesh.crease_angle = options.crease_angle;
  find_feature_edges(source, joined, prepared, mesh);
  mesh.min_corner = source.min_corner;
  mesh.max_corner = source.max_corner;
  mesh.center = source.center;
  mesh.radius = source.radius;
  mesh.cull_back_faces = source.closed && !options.two_sided;
  return mesh;
}

}  // namespace sightline
