// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>

#include "geometry/mesh_readers.hpp"
#include "geometry/repair/mesh_repair.hpp"

namespace sightline::geometry {
namespace {

using Points2 = std::vector<Eigen::Vector2d>;

/// Newell's normal: right for concave polygons and those slightly out of plane.
Eigen::Vector3d newell_normal(const std::vector<Eigen::Vector3f>& corners) {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  const Eigen::Vector3d origin = corners[0].cast<double>();
  for (size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector3d a = corners[i].cast<double>() - origin;
    const Eigen::Vector3d b = corners[(i + 1) % corners.size()].cast<double>() - origin;
    normal += a.cross(b);
  }
  return normal;
}

/// Drops the axis along which the polygon is flattest, so that it turns counter-clockwise.
Points2 flatten(const std::vector<Eigen::Vector3f>& corners) {
  const Eigen::Vector3d normal = newell_normal(corners);
  Eigen::Index axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  Eigen::Index u = (axis + 1) % 3;
  Eigen::Index v = (axis + 2) % 3;
  if (normal(axis) < 0) std::swap(u, v);
  Points2 flat;
  for (const Eigen::Vector3f& c : corners) flat.emplace_back(c(u), c(v));
  return flat;
}

double turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

bool covers(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
            const Eigen::Vector2d& p) {
  if (p == a || p == b || p == c) return false;
  return turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
}

/// True if the corner at position i of the remaining polygon can be cut off.
bool is_ear(const Points2& flat, const std::vector<uint32_t>& rest, size_t i) {
  const size_t n = rest.size();
  const Eigen::Vector2d& a = flat[rest[(i + n - 1) % n]];
  const Eigen::Vector2d& b = flat[rest[i]];
  const Eigen::Vector2d& c = flat[rest[(i + 1) % n]];
  if (!(turn(a, b, c) > 0)) return false;
  return std::none_of(rest.begin(), rest.end(),
                      [&](uint32_t k) { return covers(a, b, c, flat[k]); });
}

}  // namespace

void clip_ears(const std::vector<Eigen::Vector3f>& corners,
               std::vector<std::array<uint32_t, 3>>* triangles) {
  std::vector<uint32_t> rest(corners.size());
  for (uint32_t i = 0; i < rest.size(); ++i) rest[i] = i;
  const Points2 flat = corners.size() > 3 ? flatten(corners) : Points2{};
  size_t at = 0;
  while (rest.size() > 3) {
    const size_t n = rest.size();
    size_t tried = 0;
    while (tried < n && !is_ear(flat, rest, (at + tried) % n)) ++tried;
    // A polygon that crosses itself may have no ear left: cut anywhere, so that it ends.
    at = (at + (tried < n ? tried : 0)) % n;
    triangles->push_back({rest[(at + n - 1) % n], rest[at], rest[(at + 1) % n]});
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(at));
    if (at >= rest.size()) at = 0;
  }
  if (rest.size() == 3) triangles->push_back({rest[0], rest[1], rest[2]});
}

Result<TriangleMesh> triangulate_polygons(const PolygonMesh& polygons, const std::string& where,
                                          const MeshOptions& options) {
  TriangleMesh mesh;
  mesh.vertices = polygons.vertices;
  const bool has_normals = !polygons.corner_normals.empty();
  if (has_normals) mesh.normals = polygons.normals;
  size_t start = 0;
  std::vector<Eigen::Vector3f> corners;
  std::vector<std::array<uint32_t, 3>> triangles;
  for (size_t f = 0; f < polygons.corner_counts.size(); ++f) {
    const size_t count = polygons.corner_counts[f];
    corners.clear();
    triangles.clear();
    for (size_t i = 0; i < count; ++i) {
      corners.push_back(polygons.vertices[polygons.corner_vertices[start + i]]);
    }
    clip_ears(corners, &triangles);
    for (const auto& t : triangles) {
      const auto pick = [&](const std::vector<uint32_t>& of) {
        return std::array<uint32_t, 3>{of[start + t[0]], of[start + t[1]], of[start + t[2]]};
      };
      mesh.faces.push_back(pick(polygons.corner_vertices));
      if (has_normals) mesh.face_normals.push_back(pick(polygons.corner_normals));
      if (!polygons.face_colors.empty()) mesh.face_colors.push_back(polygons.face_colors[f]);
    }
    start += count;
  }
  repair_mesh(&mesh);
  return finish_mesh(std::move(mesh), where, options);
}

}  // namespace sightline::geometry
