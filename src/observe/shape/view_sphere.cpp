// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/view_sphere.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace sightline::observe {
namespace {

using Triangle = std::array<uint16_t, 3>;

std::vector<Eigen::Vector3d> icosahedron_corners() {
  const double g = (1 + std::sqrt(5.0)) / 2;
  std::vector<Eigen::Vector3d> corners = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                                          {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                                          {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
  for (Eigen::Vector3d& corner : corners) corner.normalize();
  return corners;
}

std::vector<Triangle> icosahedron_faces() {
  return {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
          {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
          {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
}

std::vector<Triangle> split(const std::vector<Triangle>& faces,
                            std::vector<Eigen::Vector3d>& corners) {
  std::map<std::pair<uint16_t, uint16_t>, uint16_t> middles;
  const auto middle = [&](uint16_t a, uint16_t b) {
    const auto [entry, made] = middles.try_emplace({std::min(a, b), std::max(a, b)});
    if (made) {
      entry->second = static_cast<uint16_t>(corners.size());
      corners.push_back((corners[a] + corners[b]).normalized());
    }
    return entry->second;
  };
  std::vector<Triangle> out;
  for (const auto& [a, b, c] : faces) {
    const uint16_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    out.insert(out.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
  }
  return out;
}

}  // namespace

ViewSphere make_view_sphere(int subdivisions) {
  ViewSphere sphere;
  sphere.directions = icosahedron_corners();
  std::vector<Triangle> faces = icosahedron_faces();
  for (int i = 0; i < subdivisions; ++i) faces = split(faces, sphere.directions);
  std::vector<std::set<uint16_t>> next(sphere.directions.size());
  for (const Triangle& face : faces) {
    for (const uint16_t a : face) {
      for (const uint16_t b : face) {
        if (a != b) next[a].insert(b);
      }
    }
  }
  for (const auto& set : next) {
    std::array<uint16_t, 6> list{};
    std::copy(set.begin(), set.end(), list.begin());
    sphere.neighbors.push_back(list);
    sphere.counts.push_back(static_cast<uint8_t>(set.size()));
  }
  return sphere;
}

}  // namespace sightline::observe
