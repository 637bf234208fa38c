// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "geometry/mesh_readers.hpp"
#include "geometry/repair/half_edges.hpp"

namespace sightline {

using namespace geometry;

namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
constexpr double kMinExtent = 1e-6;  // [m]

using Index3 = std::array<uint32_t, 3>;

Status check_options(const MeshOptions& options, const std::string& where) {
  if (!(options.meters_per_unit > 0) || !std::isfinite(options.meters_per_unit)) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "the unit is {} meters, it must be a positive number",
                      options.meters_per_unit);
  }
  return {};
}

Status check_counts(const TriangleMesh& mesh, const std::string& where,
                    const MeshOptions& options) {
  if (mesh.faces.empty()) return make_error(ErrorCode::kInvalidInput, where, "mesh has no faces");
  if (mesh.faces.size() > options.max_faces) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "mesh has {} triangles, the limit is {}; simplify it", mesh.faces.size(),
                      options.max_faces);
  }
  if (mesh.vertices.size() >= kNone || mesh.normals.size() >= kNone) {
    return make_error(ErrorCode::kInvalidInput, where, "mesh has too many vertices");
  }
  if (!mesh.normals.empty() && mesh.face_normals.size() != mesh.faces.size()) {
    return make_error(ErrorCode::kInvalidInput, where, "{} faces but normals for {}",
                      mesh.faces.size(), mesh.face_normals.size());
  }
  if (!mesh.face_colors.empty() && mesh.face_colors.size() != mesh.faces.size()) {
    return make_error(ErrorCode::kInvalidInput, where, "{} faces but colors for {}",
                      mesh.faces.size(), mesh.face_colors.size());
  }
  return {};
}

Status check_finite(const std::vector<Eigen::Vector3f>& values, const char* what,
                    const std::string& where) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (!values[i].allFinite()) {
      return make_error(ErrorCode::kInvalidInput, where, "{} {} is not finite: {} {} {}", what, i,
                        values[i].x(), values[i].y(), values[i].z());
    }
  }
  return {};
}

Status check_indices(const std::vector<Index3>& faces, size_t count, const char* what,
                     const std::string& where) {
  for (size_t f = 0; f < faces.size(); ++f) {
    for (uint32_t index : faces[f]) {
      if (index >= count) {
        return make_error(ErrorCode::kInvalidInput, where, "face {}: {} index {} of {}", f, what,
                          index, count);
      }
    }
  }
  return {};
}

bool position_less(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Merges vertices at the same place and drops those no face uses; the order stays.
void weld_vertices(TriangleMesh* mesh) {
  const std::vector<Eigen::Vector3f>& v = mesh->vertices;
  std::vector<uint32_t> order(v.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&v](uint32_t a, uint32_t b) {
    if (position_less(v[a], v[b])) return true;
    return !position_less(v[b], v[a]) && a < b;
  });
  std::vector<uint32_t> first_at_place(v.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && !position_less(v[order[i - 1]], v[order[i]]);
    first_at_place[order[i]] = same ? first_at_place[order[i - 1]] : order[i];
  }
  std::vector<bool> used(v.size(), false);
  for (const Index3& face : mesh->faces) {
    for (uint32_t index : face) used[first_at_place[index]] = true;
  }
  std::vector<uint32_t> renamed(v.size(), kNone);
  std::vector<Eigen::Vector3f> kept;
  for (uint32_t i = 0; i < v.size(); ++i) {
    if (!used[i]) continue;
    renamed[i] = static_cast<uint32_t>(kept.size());
    kept.push_back(v[i]);
  }
  for (Index3& face : mesh->faces) {
    for (uint32_t& index : face) index = renamed[first_at_place[index]];
  }
  mesh->vertices = std::move(kept);
}

/// Every edge belongs to two faces that run along it in opposite directions. Slivers without area
/// count, for the surface is closed with them.
bool is_closed(const std::vector<Index3>& faces) {
  const std::vector<HalfEdge> edges = half_edges(faces);
  bool closed = !edges.empty();
  for_each_edge(edges, [&](std::span<const HalfEdge> sides) {
    closed &= sides.size() == 2 && sides[0].forward != sides[1].forward;
  });
  return closed;
}

Eigen::Vector3d area_vector(const TriangleMesh& mesh, const Index3& f) {
  const Eigen::Vector3d a = mesh.vertices[f[0]].cast<double>();
  return (mesh.vertices[f[1]].cast<double>() - a).cross(mesh.vertices[f[2]].cast<double>() - a);
}

bool has_area(const TriangleMesh& mesh, const Index3& f) {
  if (collapsed(f)) return false;
  double longest = 0;
  for (size_t i = 0; i < 3; ++i) {
    longest = std::max<double>(
        longest,
        (mesh.vertices[f[i]] - mesh.vertices[f[(i + 1) % 3]]).cast<double>().squaredNorm());
  }
  return area_vector(mesh, f).norm() > 1e-12 * longest;
}

void drop_faces_without_area(TriangleMesh* mesh) {
  size_t kept = 0;
  for (size_t f = 0; f < mesh->faces.size(); ++f) {
    if (!has_area(*mesh, mesh->faces[f])) continue;
    mesh->faces[kept] = mesh->faces[f];
    if (!mesh->face_normals.empty()) mesh->face_normals[kept] = mesh->face_normals[f];
    if (!mesh->face_colors.empty()) mesh->face_colors[kept] = mesh->face_colors[f];
    ++kept;
  }
  mesh->faces.resize(kept);
  if (!mesh->face_normals.empty()) mesh->face_normals.resize(kept);
  if (!mesh->face_colors.empty()) mesh->face_colors.resize(kept);
}

/// Unit length for the file's normals; a corner whose normal is zero gets that of its face.
void normalize_normals(TriangleMesh* mesh) {
  std::vector<bool> zero(mesh->normals.size(), false);
  for (size_t i = 0; i < mesh->normals.size(); ++i) {
    const Eigen::Vector3d n = mesh->normals[i].cast<double>();
    const double length = n.norm();
    zero[i] = !(length > 1e-30);
    if (!zero[i]) mesh->normals[i] = (n / length).cast<float>();
  }
  for (size_t f = 0; f < mesh->faces.size(); ++f) {
    uint32_t own = kNone;
    for (uint32_t& index : mesh->face_normals[f]) {
      if (!zero[index]) continue;
      if (own == kNone) {
        own = static_cast<uint32_t>(mesh->normals.size());
        mesh->normals.push_back(area_vector(*mesh, mesh->faces[f]).normalized().cast<float>());
      }
      index = own;
    }
  }
}

Status set_bounds(TriangleMesh* mesh, const std::string& where, const MeshOptions& options) {
  mesh->min_corner = mesh->max_corner = mesh->vertices.front();
  for (const Eigen::Vector3f& v : mesh->vertices) {
    mesh->min_corner = mesh->min_corner.cwiseMin(v);
    mesh->max_corner = mesh->max_corner.cwiseMax(v);
  }
  const double extent =
      (mesh->max_corner.cast<double>() - mesh->min_corner.cast<double>()).maxCoeff();
  if (extent < kMinExtent || extent > options.max_extent) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "mesh is {:.6g} m large at {:.6g} m per unit, allowed is {} to {} m; is the "
                      "unit right (0.001 for millimeters)?",
                      extent, options.meters_per_unit, kMinExtent, options.max_extent);
  }
  mesh->center =
      (0.5 * (mesh->min_corner.cast<double>() + mesh->max_corner.cast<double>())).cast<float>();
  float squared = 0;
  for (const Eigen::Vector3f& v : mesh->vertices) {
    squared = std::max(squared, (v - mesh->center).squaredNorm());
  }
  mesh->radius = std::sqrt(squared);
  return {};
}

}  // namespace

Result<TriangleMesh> finish_mesh(TriangleMesh mesh, const std::string& where,
                                 const MeshOptions& options) {
  SL_RETURN_IF_ERROR(check_options(options, where));
  SL_RETURN_IF_ERROR(check_counts(mesh, where, options));
  SL_RETURN_IF_ERROR(check_indices(mesh.faces, mesh.vertices.size(), "vertex", where));
  SL_RETURN_IF_ERROR(check_indices(mesh.face_normals, mesh.normals.size(), "normal", where));
  for (Eigen::Vector3f& v : mesh.vertices) {
    v = (options.meters_per_unit * v.cast<double>()).cast<float>();
  }
  SL_RETURN_IF_ERROR(check_finite(mesh.vertices, "vertex", where));
  SL_RETURN_IF_ERROR(check_finite(mesh.normals, "normal", where));
  SL_RETURN_IF_ERROR(check_finite(mesh.face_colors, "color of face", where));
  for (Eigen::Vector3f& c : mesh.face_colors) c = c.cwiseMax(0.0f).cwiseMin(1.0f);

  weld_vertices(&mesh);
  SL_RETURN_IF_ERROR(set_bounds(&mesh, where, options));
  mesh.closed = is_closed(mesh.faces);
  drop_faces_without_area(&mesh);
  if (mesh.faces.empty()) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "no face of the mesh has an area; all corners of each lie on a line");
  }
  if (mesh.normals.empty()) {
    make_normals(&mesh, options.crease_angle);
  } else {
    normalize_normals(&mesh);
  }
  return mesh;
}

}  // namespace sightline
