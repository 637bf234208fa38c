// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh_edges.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

namespace sightline {
namespace {

constexpr uint32_t kNone = ~uint32_t{0};

// A mesh of so many faces whose creases are so long, in diameters, is a scan with noise: models
// have up to 65, those of so many faces up to 46.
constexpr size_t kManyFaces = 8000;
constexpr double kMostCreases = 55;
constexpr double kReach = 0.04;      // [radii] as far as a mean normal reaches
constexpr float kAlong = 0.7f;       // cosine between an edge and the line that it is part of
constexpr size_t kMostFaces = 1000;  // of one mean

struct HalfEdge {
  uint32_t low, high, face;
};

/// For each vertex the first one at the same place: files split vertices at creases and seams.
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

/// What there is to know of a mesh's faces and of the edges between them.
class Faces {
 public:
  explicit Faces(const TriangleMesh& mesh)
      : mesh_(mesh), neighbors_(mesh.faces.size(), {kNone, kNone, kNone}) {
    for (const auto& face : mesh.faces) {
      const Eigen::Vector3f& p = mesh.vertices[face[0]];
      across_.emplace_back((mesh.vertices[face[1]] - p).cross(mesh.vertices[face[2]] - p));
      normals_.push_back(across_.back().normalized());
    }
  }

  bool bent(uint32_t a, uint32_t b, float min_cosine) const {
    return !(normals_[a].dot(normals_[b]) >= min_cosine);
  }
  double length(const MeshEdge& edge) const {
    return static_cast<double>((mesh_.vertices[edge.end] - mesh_.vertices[edge.start]).norm());
  }
  void join(uint32_t a, uint32_t b) {
    for (const auto& [face, other] : {std::pair(a, b), std::pair(b, a)}) {
      auto& slots = neighbors_[face];
      *std::min_element(slots.begin(), slots.end(),
                        [](uint32_t x, uint32_t y) { return (x == kNone) > (y == kNone); }) = other;
    }
  }

  /// Do the means of the normals to either side of an edge differ as well, along the edge? Noise
  /// does not. Turns the edge's direction to where the two sides meet.
  bool bent_as_a_whole(float min_cosine, MeshEdge& edge) {
    const Eigen::Vector3f middle = (mesh_.vertices[edge.start] + mesh_.vertices[edge.end]) / 2;
    gather(edge, middle);
    Eigen::Vector3f up = Eigen::Vector3f::Zero();
    for (const uint32_t f : around_) up += across_[f];
    const Eigen::Vector3f aside = edge.along.cross(up);
    std::array<Eigen::Vector3f, 2> sides = {Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
    for (const uint32_t f : around_) sides[aside.dot(center(f) - middle) > 0 ? 1 : 0] += across_[f];
    for (Eigen::Vector3f& side : sides) side.normalize();
    if (sides[0].dot(sides[1]) >= min_cosine) return false;
    const Eigen::Vector3f line = sides[0].cross(sides[1]).normalized();
    const float with = line.dot(edge.along);
    if (std::abs(with) < kAlong) return false;
    edge.along = with > 0 ? line : Eigen::Vector3f(-line);
    return true;
  }

 private:
  Eigen::Vector3f center(uint32_t f) const {
    const auto& face = mesh_.faces[f];
    return (mesh_.vertices[face[0]] + mesh_.vertices[face[1]] + mesh_.vertices[face[2]]) / 3;
  }
  // The faces beside an edge and what hangs together with them nearby.
  void gather(const MeshEdge& edge, const Eigen::Vector3f& middle) {
    const float reach = static_cast<float>(kReach) * mesh_.radius;
    around_ = {edge.first_face, edge.second_face};
    seen_.resize(mesh_.faces.size(), kNone);
    ++looks_;
    seen_[edge.first_face] = seen_[edge.second_face] = looks_;
    for (size_t i = 0; i < around_.size() && around_.size() < kMostFaces; ++i) {
      for (const uint32_t f : neighbors_[around_[i]]) {
        if (f == kNone || seen_[f] == looks_) continue;
        seen_[f] = looks_;
        if ((center(f) - middle).squaredNorm() <= reach * reach) around_.push_back(f);
      }
    }
  }

  const TriangleMesh& mesh_;
  std::vector<std::array<uint32_t, 3>> neighbors_;  // of the edges that two faces share
  std::vector<Eigen::Vector3f> across_, normals_;   // twice the area along the normal; unit
  std::vector<uint32_t> seen_, around_;
  uint32_t looks_ = 0;
};

}  // namespace

std::vector<MeshEdge> feature_edges(const TriangleMesh& mesh, double crease_angle) {
  const std::vector<HalfEdge> edges = half_edges(mesh);
  Faces faces(mesh);
  const auto min_cosine = static_cast<float>(std::cos(crease_angle));
  std::vector<MeshEdge> out, creases;
  double bent = 0;
  for (size_t i = 0; i < edges.size();) {
    size_t end = i + 1;
    while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high)
      ++end;
    const uint32_t first = edges[i].face;
    const uint32_t second = end - i > 1 ? edges[i + 1].face : first;
    const Eigen::Vector3f way = mesh.vertices[edges[i].high] - mesh.vertices[edges[i].low];
    const MeshEdge edge{edges[i].low, edges[i].high, first, second, way.normalized()};
    const bool shared = end - i == 2;
    i = end;
    if (shared) faces.join(edge.first_face, edge.second_face);
    if (shared && !faces.bent(edge.first_face, edge.second_face, min_cosine)) continue;
    (shared ? creases : out).push_back(edge);
    if (shared) bent += faces.length(edge);
  }
  if (mesh.faces.size() >= kManyFaces && bent > kMostCreases * 2 * double{mesh.radius}) {
    std::vector<MeshEdge> of_the_shape;
    for (MeshEdge edge : creases) {
      if (faces.bent_as_a_whole(min_cosine, edge)) of_the_shape.push_back(edge);
    }
    creases = std::move(of_the_shape);
  }
  const auto borders = static_cast<ptrdiff_t>(out.size());
  out.insert(out.end(), creases.begin(), creases.end());
  std::inplace_merge(out.begin(), out.begin() + borders, out.end(),
                     [](const MeshEdge& a, const MeshEdge& b) {
                       return std::tie(a.start, a.end) < std::tie(b.start, b.end);
                     });
  return out;
}

}  // namespace sightline
