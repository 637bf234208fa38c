// SPDX-License-Identifier: Apache-2.0
#include "support/ray_mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace sightline::test {
namespace {

constexpr uint32_t kLeaf = 4;
constexpr int kBins = 12;

}  // namespace

float RayMesh::Box::area() const {
  const Eigen::Array3f size = (high - low).max(0.0f);
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

RayMesh::RayMesh(TriangleMesh mesh) : mesh_(std::move(mesh)) {
  order_.resize(mesh_.faces.size());
  std::iota(order_.begin(), order_.end(), 0u);
  for (const auto& face : mesh_.faces) {
    Box box;
    for (const uint32_t v : face) {
      box.low = box.low.min(mesh_.vertices[v].array());
      box.high = box.high.max(mesh_.vertices[v].array());
    }
    boxes_.push_back(box);
  }
  build(0, static_cast<uint32_t>(order_.size()));
  for (const uint32_t face : order_) {
    const auto& f = mesh_.faces[face];
    const Eigen::Vector3f& corner = mesh_.vertices[f[0]];
    triangles_.push_back({corner, mesh_.vertices[f[1]] - corner, mesh_.vertices[f[2]] - corner});
  }
  boxes_ = {};
}

void RayMesh::build(uint32_t first, uint32_t count) {
  const size_t self = nodes_.size();
  nodes_.emplace_back();
  Box box, middles;
  for (uint32_t i = first; i < first + count; ++i) {
    const Box& each = boxes_[order_[i]];
    const Eigen::Array3f middle = 0.5f * (each.low + each.high);
    box.add(each);
    middles.add({middle, middle});
  }
  nodes_[self].box = box;
  const uint32_t left = count > kLeaf ? split(first, count, middles) : 0;
  if (left == 0 || left == count) {
    nodes_[self].first = first;
    nodes_[self].count = count;
    return;
  }
  build(first, left);
  nodes_[self].first = static_cast<uint32_t>(nodes_.size());
  build(first + left, count - left);
}

// Sorts the faces into two groups along the axis and at the place where the two boxes are cheapest
// to hit; how many are in the first group.
uint32_t RayMesh::split(uint32_t first, uint32_t count, const Box& middles) {
  float best = 1e30f;
  int best_axis = -1, best_bin = 0;
  const auto bin_of = [&](uint32_t face, int axis) {
    const float size = middles.high[axis] - middles.low[axis];
    const float middle = 0.5f * (boxes_[face].low[axis] + boxes_[face].high[axis]);
    return std::clamp(static_cast<int>(kBins * (middle - middles.low[axis]) / size), 0, kBins - 1);
  };
  for (int axis = 0; axis < 3; ++axis) {
    if (!(middles.high[axis] > middles.low[axis])) continue;
    std::array<Box, kBins> bins;
    std::array<uint32_t, kBins> counts{};
    for (uint32_t i = first; i < first + count; ++i) {
      const auto bin = static_cast<size_t>(bin_of(order_[i], axis));
      bins[bin].add(boxes_[order_[i]]);
      ++counts[bin];
    }
    for (int cut = 1; cut < kBins; ++cut) {
      Box sides[2];
      uint32_t in_side[2] = {0, 0};
      for (int bin = 0; bin < kBins; ++bin) {
        sides[bin < cut ? 0 : 1].add(bins[static_cast<size_t>(bin)]);
        in_side[bin < cut ? 0 : 1] += counts[static_cast<size_t>(bin)];
      }
      if (in_side[0] == 0 || in_side[1] == 0) continue;
      const float cost = sides[0].area() * static_cast<float>(in_side[0]) +
                         sides[1].area() * static_cast<float>(in_side[1]);
      if (cost < best) best = cost, best_axis = axis, best_bin = cut;
    }
  }
  if (best_axis < 0) return 0;
  const auto begin = order_.begin() + first;
  const auto middle = std::partition(
      begin, begin + count, [&](uint32_t face) { return bin_of(face, best_axis) < best_bin; });
  return static_cast<uint32_t>(middle - begin);
}

// Moeller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
void RayMesh::try_triangle(uint32_t index, const Eigen::Vector3f& origin,
                           const Eigen::Vector3f& direction, Nearest& nearest) const {
  const Triangle& t = triangles_[index];
  const Eigen::Vector3f p = direction.cross(t.side_v);
  const float determinant = t.side_u.dot(p);
  if (determinant == 0) return;
  const float inverse = 1 / determinant;
  const Eigen::Vector3f s = origin - t.corner;
  const float u = s.dot(p) * inverse;
  if (!(u >= 0 && u <= 1)) return;
  const Eigen::Vector3f q = s.cross(t.side_u);
  const float v = direction.dot(q) * inverse;
  if (!(v >= 0 && u + v <= 1)) return;
  const float distance = t.side_v.dot(q) * inverse;
  if (!(distance > 0 && distance < nearest.distance)) return;
  nearest = {distance, index, u, v, true};
}

std::optional<RayHit> RayMesh::cast(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                                    float limit) const {
  Nearest nearest{limit};
  const Eigen::Array3f inverse = direction.array().inverse();
  const auto entry = [&](const Box& box) {
    const Eigen::Array3f a = (box.low - origin.array()) * inverse;
    const Eigen::Array3f b = (box.high - origin.array()) * inverse;
    const float in = std::max(0.0f, a.min(b).maxCoeff());
    const float out = a.max(b).minCoeff();
    return in <= out ? in : 1e30f;
  };
  uint32_t stack[64];
  int depth = 0;
  if (!nodes_.empty() && entry(nodes_[0].box) < limit) stack[depth++] = 0;
  while (depth > 0) {
    const uint32_t at = stack[--depth];
    const Node& node = nodes_[at];
    if (node.count > 0) {
      for (uint32_t i = node.first; i < node.first + node.count; ++i) {
        try_triangle(i, origin, direction, nearest);
      }
      continue;
    }
    uint32_t near = at + 1, far = node.first;
    float near_in = entry(nodes_[near].box), far_in = entry(nodes_[far].box);
    if (far_in < near_in) std::swap(near, far), std::swap(near_in, far_in);
    if (far_in < nearest.distance) stack[depth++] = far;
    if (near_in < nearest.distance) stack[depth++] = near;
  }
  if (!nearest.found) return std::nullopt;
  const uint32_t face = order_[nearest.triangle];
  const auto& normals = mesh_.face_normals[face];
  const Eigen::Vector3f normal = (1 - nearest.u - nearest.v) * mesh_.normals[normals[0]] +
                                 nearest.u * mesh_.normals[normals[1]] +
                                 nearest.v * mesh_.normals[normals[2]];
  return RayHit{nearest.distance, face, origin + nearest.distance * direction, normal.normalized()};
}

}  // namespace sightline::test
