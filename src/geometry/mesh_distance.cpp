// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh_distance.hpp"

#include <algorithm>
#include <limits>

namespace sightline {
namespace {

constexpr size_t kLeaf = 4;

}  // namespace

Eigen::Vector3d nearest_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                    const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Eigen::Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const Eigen::Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const double sum = va + vb + vc;
  return a + vb / sum * ab + vc / sum * ac;
}

double MeshDistance::Box::squared_distance(const Eigen::Vector3d& point) const {
  return (low - point.array()).max(point.array() - high).max(0.0).matrix().squaredNorm();
}

MeshDistance::MeshDistance(const TriangleMesh& mesh) {
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    const auto& f = mesh.faces[i];
    faces_.push_back({mesh.vertices[f[0]].cast<double>(), mesh.vertices[f[1]].cast<double>(),
                      mesh.vertices[f[2]].cast<double>(), static_cast<uint32_t>(i)});
  }
  build(0, faces_.size());
}

// Halves of equal number along the longest side.
void MeshDistance::build(size_t first, size_t count) {
  const size_t self = nodes_.size();
  nodes_.emplace_back();
  Box box;
  for (size_t i = first; i < first + count; ++i) {
    for (const auto* v : {&faces_[i].a, &faces_[i].b, &faces_[i].c}) {
      box.low = box.low.min(v->array());
      box.high = box.high.max(v->array());
    }
  }
  nodes_[self].box = box;
  if (count <= kLeaf) {
    nodes_[self].first = static_cast<uint32_t>(first);
    nodes_[self].count = static_cast<uint32_t>(count);
    return;
  }
  Eigen::Index axis = 0;
  (box.high - box.low).maxCoeff(&axis);
  const auto begin = faces_.begin() + static_cast<ptrdiff_t>(first);
  const size_t half = count / 2;
  const auto middle = [axis](const Face& f) { return f.a[axis] + f.b[axis] + f.c[axis]; };
  std::nth_element(begin, begin + static_cast<ptrdiff_t>(half),
                   begin + static_cast<ptrdiff_t>(count), [&](const Face& p, const Face& q) {
                     const double u = middle(p), v = middle(q);
                     return u != v ? u < v : p.index < q.index;
                   });
  build(first, half);
  nodes_[self].first = static_cast<uint32_t>(nodes_.size());
  build(first + half, count - half);
}

SurfacePoint MeshDistance::nearest(const Eigen::Vector3d& point) const {
  double min = std::numeric_limits<double>::infinity();
  SurfacePoint found;
  uint32_t stack[64];  // deeper than any tree of 2^32 faces in equal halves
  int depth = 0;
  if (!nodes_.empty()) stack[depth++] = 0;
  while (depth > 0) {
    const uint32_t at = stack[--depth];
    const Node& node = nodes_[at];
    if (node.box.squared_distance(point) >= min) continue;
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Face& face = faces_[i];
      const Eigen::Vector3d on = nearest_on_triangle(point, face.a, face.b, face.c);
      const double squared = (on - point).squaredNorm();
      if (squared < min) min = squared, found = {on, face.index, 0};
    }
    if (node.count > 0) continue;
    uint32_t near = at + 1, far = node.first;
    if (nodes_[far].box.squared_distance(point) < nodes_[near].box.squared_distance(point)) {
      std::swap(near, far);
    }
    stack[depth++] = far;
    stack[depth++] = near;
  }
  found.distance = std::sqrt(min);
  return found;
}

}  // namespace sightline
