// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh_edges.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>
#include <tuple>

#include "geometry/repair/half_edges.hpp"

namespace sightline {

using namespace geometry;

namespace {

// A surface of whose creases (by length) so many are none by its mean normals is noisy: of models
// up to 0.03 are, of scans 0.36 and more.
constexpr double kNoisyShare = 0.2;
constexpr double kReach = 0.04;      // [radii] as far as a mean normal reaches
constexpr float kAlong = 0.7f;       // cosine between an edge and the crease that it is part of
constexpr size_t kFewFaces = 12;     // whose mean says no more than they do
constexpr size_t kMostFaces = 1000;  // of one mean

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

std::vector<HalfEdge> joined_half_edges(const TriangleMesh& mesh) {
  const std::vector<uint32_t> joined = joined_vertices(mesh.vertices);
  std::vector<std::array<uint32_t, 3>> faces = mesh.faces;
  for (auto& face : faces) {
    for (uint32_t& vertex : face) vertex = joined[vertex];
  }
  return half_edges(faces);
}

/// Which edges are creases: by the normals of their two faces, or by mean normals to either side.
class Creases {
 public:
  Creases(const TriangleMesh& mesh, double crease_angle)
      : mesh_(mesh),
        min_cosine_(static_cast<float>(std::cos(crease_angle))),
        neighbors_(mesh.faces.size()),
        visited_(mesh.faces.size(), 0) {
    for (const auto& face : mesh.faces) {
      const Eigen::Vector3f& p = mesh.vertices[face[0]];
      area_vectors_.emplace_back((mesh.vertices[face[1]] - p).cross(mesh.vertices[face[2]] - p));
    }
  }

  void join(const HalfEdge& a, const HalfEdge& b) { neighbors_.join(a, b); }

  bool by_faces(const MeshEdge& edge) const {
    return differ(area_vectors_[edge.first_face], area_vectors_[edge.second_face]);
  }

  /// Also turns the tangent to where the two sides meet.
  bool by_mean_normals(MeshEdge& edge) {
    const Eigen::Vector3f middle = (mesh_.vertices[edge.start] + mesh_.vertices[edge.end]) / 2;
    gather_patch(edge, middle);
    if (patch_.size() < kFewFaces) return by_faces(edge);
    Eigen::Vector3f up = Eigen::Vector3f::Zero();
    for (const uint32_t f : patch_) up += area_vectors_[f];
    const Eigen::Vector3f aside = edge.tangent.cross(up);
    Eigen::Vector3f left = Eigen::Vector3f::Zero(), right = left;
    for (const uint32_t f : patch_)
      (aside.dot(center(f) - middle) > 0 ? right : left) += area_vectors_[f];
    if (!differ(left, right)) return false;
    const Eigen::Vector3f crease = left.cross(right).normalized();
    const float cosine = crease.dot(edge.tangent);
    if (std::abs(cosine) < kAlong) return false;
    edge.tangent = cosine > 0 ? crease : Eigen::Vector3f(-crease);
    return true;
  }

 private:
  bool differ(const Eigen::Vector3f& a, const Eigen::Vector3f& b) const {
    return !(a.normalized().dot(b.normalized()) >= min_cosine_);
  }
  Eigen::Vector3f center(uint32_t f) const {
    const auto& face = mesh_.faces[f];
    return (mesh_.vertices[face[0]] + mesh_.vertices[face[1]] + mesh_.vertices[face[2]]) / 3;
  }
  // The faces beside an edge and those connected with them nearby.
  void gather_patch(const MeshEdge& edge, const Eigen::Vector3f& middle) {
    const float reach = static_cast<float>(kReach) * mesh_.radius;
    patch_ = {edge.first_face, edge.second_face};
    ++visit_;
    visited_[edge.first_face] = visited_[edge.second_face] = visit_;
    for (size_t i = 0; i < patch_.size() && patch_.size() < kMostFaces; ++i) {
      for (const FaceNeighbor& neighbor : neighbors_.of(patch_[i])) {
        const uint32_t f = neighbor.face;
        if (f == kNoFace || visited_[f] == visit_) continue;
        visited_[f] = visit_;
        if ((center(f) - middle).squaredNorm() <= reach * reach) patch_.push_back(f);
      }
    }
  }

  const TriangleMesh& mesh_;
  float min_cosine_;
  FaceNeighbors neighbors_;
  std::vector<Eigen::Vector3f> area_vectors_;  // twice that
  std::vector<uint32_t> visited_, patch_;
  uint32_t visit_ = 0;
};

double length_of(const std::vector<MeshEdge>& edges, const TriangleMesh& mesh) {
  double length = 0;
  for (const MeshEdge& edge : edges)
    length += static_cast<double>((mesh.vertices[edge.end] - mesh.vertices[edge.start]).norm());
  return length;
}

}  // namespace

std::vector<MeshEdge> feature_edges(const TriangleMesh& mesh, double crease_angle) {
  Creases creases(mesh, crease_angle);
  std::vector<MeshEdge> others, bent;
  for_each_edge(joined_half_edges(mesh), [&](std::span<const HalfEdge> sides) {
    const auto& [low, high, first_face, forward] = sides.front();
    const Eigen::Vector3f way = mesh.vertices[high] - mesh.vertices[low];
    const uint32_t second_face = sides.size() > 1 ? sides[1].face : first_face;
    const MeshEdge edge{low, high, first_face, second_face, way.normalized()};
    if (sides.size() != 2) {
      others.push_back(edge);
      return;
    }
    creases.join(sides[0], sides[1]);
    if (creases.by_faces(edge)) bent.push_back(edge);
  });
  std::vector<MeshEdge> of_the_shape;
  for (MeshEdge edge : bent) {
    if (creases.by_mean_normals(edge)) of_the_shape.push_back(edge);
  }
  const bool noisy = length_of(of_the_shape, mesh) < (1 - kNoisyShare) * length_of(bent, mesh);
  std::vector<MeshEdge> out;
  std::ranges::merge(others, noisy ? of_the_shape : bent, std::back_inserter(out),
                     [](const MeshEdge& a, const MeshEdge& b) {
                       return std::tie(a.start, a.end) < std::tie(b.start, b.end);
                     });
  return out;
}

}  // namespace sightline
