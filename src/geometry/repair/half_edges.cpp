// SPDX-License-Identifier: Apache-2.0
#include "geometry/repair/half_edges.hpp"

#include <algorithm>
#include <tuple>

namespace sightline::geometry {

std::vector<HalfEdge> half_edges(const std::vector<std::array<uint32_t, 3>>& faces) {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * faces.size());
  for (uint32_t f = 0; f < faces.size(); ++f) {
    if (collapsed(faces[f])) continue;
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = faces[f][k], b = faces[f][(k + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), f, a < b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.face) < std::tie(b.low, b.high, b.face);
  });
  return edges;
}

}  // namespace sightline::geometry
