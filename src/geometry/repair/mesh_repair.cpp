// SPDX-License-Identifier: Apache-2.0
#include "geometry/repair/mesh_repair.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

#include "geometry/repair/half_edges.hpp"

namespace sightline::geometry {
namespace {

using Index3 = std::array<uint32_t, 3>;

constexpr double kSamePlace = 1e-5;    // of the extent,
constexpr double kOfShortEdge = 0.05;  // and of a short edge
// Volume / area^1.5 (of a ball 0.094) below which nothing is inside, more where there are holes.
constexpr double kLeastThickness = 1e-6, kThicknessByHoles = 0.1;
constexpr double kMostOpen = 0.25;  // share of holes in the area up to which there is an inside
constexpr uint32_t kNone = ~uint32_t{0};

/// Finds vertices by their place.
class PlaceGrid {
 public:
  PlaceGrid(const std::vector<Eigen::Vector3f>& vertices, double tolerance)
      : vertices_(vertices),
        tolerance_(tolerance),
        first_(std::bit_ceil(2 * vertices.size()), kNone),
        next_(vertices.size(), kNone) {}

  /// The first vertex within the tolerance of this one, which is added if there is none.
  uint32_t find_or_add(uint32_t vertex) {
    const Cell low = cell_of(vertices_[vertex], -tolerance_);
    const Cell high = cell_of(vertices_[vertex], tolerance_);
    uint32_t found = kNone;
    for (int64_t x = low[0]; x <= high[0]; ++x) {
      for (int64_t y = low[1]; y <= high[1]; ++y) {
        for (int64_t z = low[2]; z <= high[2]; ++z)
          found = std::min(found, find_in({x, y, z}, vertex));
      }
    }
    if (found != kNone) return found;
    next_[vertex] = std::exchange(first_[list_of(cell_of(vertices_[vertex], 0))], vertex);
    return vertex;
  }

 private:
  using Cell = std::array<int64_t, 3>;

  // Cells are small, so that a file that crowds its vertices makes no long lists.
  Cell cell_of(const Eigen::Vector3f& p, double off) const {
    Cell cell{};
    for (int i = 0; i < 3; ++i) {
      cell[static_cast<size_t>(i)] =
          static_cast<int64_t>(std::floor((static_cast<double>(p[i]) + off) / (4 * tolerance_)));
    }
    return cell;
  }
  // Cells that share a list: distances tell their vertices apart.
  size_t list_of(const Cell& cell) const {
    uint64_t out = 0;
    for (const int64_t x : cell) {
      out = (out ^ static_cast<uint64_t>(x)) * 0x9E3779B97F4A7C15u;
      out ^= out >> 29;
    }
    return out & (first_.size() - 1);
  }
  uint32_t find_in(const Cell& cell, uint32_t vertex) const {
    uint32_t found = kNone;
    for (uint32_t v = first_[list_of(cell)]; v != kNone; v = next_[v]) {
      const double apart = (vertices_[v] - vertices_[vertex]).cast<double>().norm();
      if (apart <= tolerance_) found = std::min(found, v);
    }
    return found;
  }

  const std::vector<Eigen::Vector3f>& vertices_;
  double tolerance_;
  std::vector<uint32_t> first_, next_;  // of lists of vertices
};

/// Length below which one edge in a hundred is, of those that have one.
double short_edge(const std::vector<Eigen::Vector3f>& vertices, const std::vector<Index3>& faces) {
  std::vector<float> lengths;
  lengths.reserve(3 * faces.size());
  for (const Index3& f : faces) {
    for (size_t k = 0; k < 3; ++k) {
      const float length = (vertices[f[k]] - vertices[f[(k + 1) % 3]]).norm();
      if (length > 0) lengths.push_back(length);
    }
  }
  if (lengths.empty()) return 0;
  const auto at = lengths.begin() + static_cast<ptrdiff_t>(lengths.size() / 100);
  std::nth_element(lengths.begin(), at, lengths.end());
  return static_cast<double>(*at);
}

/// For each vertex itself, or the first one at its place.
std::vector<uint32_t> same_places(const std::vector<Eigen::Vector3f>& vertices,
                                  const std::vector<Index3>& faces) {
  std::vector<uint32_t> place(vertices.size());
  std::iota(place.begin(), place.end(), 0u);
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (const Eigen::Vector3f& v : vertices) {
    if (!v.allFinite()) return place;  // finish_mesh() refuses it
    low = low.cwiseMin(v.cast<double>());
    high = high.cwiseMax(v.cast<double>());
  }
  const double tolerance =
      std::min(kSamePlace * (high - low).maxCoeff(), kOfShortEdge * short_edge(vertices, faces));
  const double farthest = std::max(low.cwiseAbs().maxCoeff(), high.cwiseAbs().maxCoeff());
  if (!(tolerance > 1e-15 * farthest)) return place;  // cells have no number there
  PlaceGrid grid(vertices, tolerance);
  for (uint32_t& vertex : place) vertex = grid.find_or_add(vertex);
  return place;
}

/// Gives the faces of each connected component one winding, outward where it has an outside.
class Orientation {
 public:
  Orientation(const std::vector<Eigen::Vector3f>& vertices, const std::vector<Index3>& faces,
              std::vector<FaceRepair>* out)
      : vertices_(vertices), faces_(faces), out_(*out), neighbors_(faces.size()) {
    for_each_edge(half_edges(faces), [this](std::span<const HalfEdge> sides) {
      if (sides.size() == 2) neighbors_.join(sides[0], sides[1]);
    });
  }

  void repair() {
    std::vector<bool> seen(faces_.size(), false);
    for (uint32_t f = 0; f < faces_.size(); ++f) {
      if (!seen[f] && out_[f] != FaceRepair::kDrop) repair_component(f, seen);
    }
  }

 private:
  void repair_component(uint32_t first, std::vector<bool>& seen) {
    component_.assign(1, first);
    seen[first] = true;
    bool orientable = true;
    for (size_t i = 0; i < component_.size(); ++i) {
      const uint32_t f = component_[i];
      for (const FaceNeighbor& neighbor : neighbors_.of(f)) {
        if (neighbor.face == kNoFace) continue;
        const FaceRepair wanted = (out_[f] == FaceRepair::kReverse) == neighbor.consistent
                                      ? FaceRepair::kReverse
                                      : FaceRepair::kKeep;
        if (!seen[neighbor.face]) {
          seen[neighbor.face] = true;
          out_[neighbor.face] = wanted;
          component_.push_back(neighbor.face);
        } else if (out_[neighbor.face] != wanted) {
          orientable = false;
        }
      }
    }
    if (!orientable) {
      for (const uint32_t f : component_) out_[f] = FaceRepair::kKeep;
    } else if (is_inside_out()) {
      for (const uint32_t f : component_) {
        out_[f] = out_[f] == FaceRepair::kKeep ? FaceRepair::kReverse : FaceRepair::kKeep;
      }
    }
  }

  /// Twice the area of a face along its normal, as it is now.
  Eigen::Vector3d area_vector(uint32_t f) const {
    const Eigen::Vector3d p = corner(f, 0);
    const Eigen::Vector3d across = (corner(f, 1) - p).cross(corner(f, 2) - p);
    return out_[f] == FaceRepair::kReverse ? Eigen::Vector3d(-across) : across;
  }
  Eigen::Vector3d corner(uint32_t f, size_t k) const {
    return vertices_[faces_[f][k]].cast<double>();
  }

  // The area vectors of a closed surface cancel; what they come to is the area of its holes. The
  // volume is that of the cones from the middle of the surface (divergence theorem).
  bool is_inside_out() const {
    Eigen::Vector3d holes = Eigen::Vector3d::Zero(), middle = holes;
    double area = 0, reversed = 0, volume = 0;
    for (const uint32_t f : component_) {
      const Eigen::Vector3d across = area_vector(f);
      holes += across / 2;
      area += across.norm() / 2;
      middle += across.norm() / 2 * (corner(f, 0) + corner(f, 1) + corner(f, 2)) / 3;
      if (out_[f] == FaceRepair::kReverse) reversed += across.norm() / 2;
    }
    if (!(area > 0)) return false;
    middle /= area;
    for (const uint32_t f : component_) volume += (corner(f, 0) - middle).dot(area_vector(f)) / 6;
    const double open = holes.norm() / area;
    const double least = std::max(kLeastThickness, kThicknessByHoles * open);
    if (open < kMostOpen && std::abs(volume) > least * std::pow(area, 1.5)) return volume < 0;
    return reversed > area / 2;
  }

  const std::vector<Eigen::Vector3f>& vertices_;
  const std::vector<Index3>& faces_;
  std::vector<FaceRepair>& out_;
  FaceNeighbors neighbors_;
  std::vector<uint32_t> component_;
};

/// Marks every face whose corners an earlier one has, in any order, and collapses it.
void drop_copies(std::vector<Index3>& faces, std::vector<FaceRepair>* out) {
  std::vector<std::pair<Index3, uint32_t>> sorted;
  sorted.reserve(faces.size());
  for (uint32_t f = 0; f < faces.size(); ++f) {
    Index3 corners = faces[f];
    std::sort(corners.begin(), corners.end());
    sorted.emplace_back(corners, f);
  }
  std::sort(sorted.begin(), sorted.end());
  for (size_t i = 1; i < sorted.size(); ++i) {
    const bool same = sorted[i].first == sorted[i - 1].first;
    if (!same || collapsed(sorted[i].first)) continue;
    (*out)[sorted[i].second] = FaceRepair::kDrop;
    faces[sorted[i].second] = {0, 0, 0};
  }
}

/// Corner normals of a face that has been reversed; those that look inward now are negated.
void reverse_normals(const Index3& corners, size_t face, TriangleMesh* mesh) {
  const Eigen::Vector3f& p = mesh->vertices[corners[0]];
  const Eigen::Vector3f across =
      (mesh->vertices[corners[1]] - p).cross(mesh->vertices[corners[2]] - p);
  Index3& normals = mesh->face_normals[face];
  std::swap(normals[1], normals[2]);
  for (uint32_t& normal : normals) {
    const Eigen::Vector3f n = mesh->normals[normal];
    if (!(n.dot(across) < 0)) continue;
    normal = static_cast<uint32_t>(mesh->normals.size());
    mesh->normals.push_back(-n);
  }
}

}  // namespace

MeshRepair find_mesh_repair(const std::vector<Eigen::Vector3f>& vertices,
                            const std::vector<Index3>& faces) {
  MeshRepair repair;
  repair.faces.assign(faces.size(), FaceRepair::kKeep);
  if (vertices.empty()) return repair;
  repair.vertices = same_places(vertices, faces);
  std::vector<Index3> joined = faces;
  for (Index3& face : joined) {
    for (uint32_t& v : face) v = repair.vertices[v];
  }
  drop_copies(joined, &repair.faces);
  Orientation(vertices, joined, &repair.faces).repair();
  return repair;
}

void repair_mesh(TriangleMesh* mesh) {
  const MeshRepair repair = find_mesh_repair(mesh->vertices, mesh->faces);
  const bool has_normals = !mesh->face_normals.empty();
  size_t kept = 0;
  for (size_t f = 0; f < mesh->faces.size(); ++f) {
    if (repair.faces[f] == FaceRepair::kDrop) continue;
    Index3 face = mesh->faces[f];
    for (uint32_t& v : face) v = repair.vertices[v];
    if (has_normals) mesh->face_normals[kept] = mesh->face_normals[f];
    if (!mesh->face_colors.empty()) mesh->face_colors[kept] = mesh->face_colors[f];
    if (repair.faces[f] == FaceRepair::kReverse) {
      std::swap(face[1], face[2]);
      if (has_normals) reverse_normals(face, kept, mesh);
    }
    mesh->faces[kept++] = face;
  }
  mesh->faces.resize(kept);
  if (has_normals) mesh->face_normals.resize(kept);
  if (!mesh->face_colors.empty()) mesh->face_colors.resize(kept);
}

void repair_surface(MeshSurface* surface) {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Index3> faces;
  for (const SurfaceTriangle& triangle : surface->triangles) {
    const auto first = static_cast<uint32_t>(vertices.size());
    vertices.insert(vertices.end(), triangle.corners.begin(), triangle.corners.end());
    faces.push_back({first, first + 1, first + 2});
  }
  const MeshRepair repair = find_mesh_repair(vertices, faces);
  size_t kept = 0;
  for (size_t f = 0; f < faces.size(); ++f) {
    if (repair.faces[f] == FaceRepair::kDrop) continue;
    SurfaceTriangle& triangle = surface->triangles[f];
    if (repair.faces[f] == FaceRepair::kReverse) {
      std::swap(triangle.corners[1], triangle.corners[2]);
      std::swap(triangle.places[1], triangle.places[2]);
      std::swap(triangle.corner_colors[1], triangle.corner_colors[2]);
    }
    if (kept != f) surface->triangles[kept] = std::move(triangle);
    ++kept;
  }
  surface->triangles.resize(kept);
}

}  // namespace sightline::geometry
