// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace sightline::geometry {

/// One side of a triangle.
struct HalfEdge {
  uint32_t low, high, face;  ///< its vertices in the order of their numbers
  bool forward;              ///< the face runs from low to high
};

/// Two corners are the same: a face without sides of its own.
inline bool collapsed(const std::array<uint32_t, 3>& f) {
  return f[0] == f[1] || f[1] == f[2] || f[2] == f[0];
}

/// The sides of all faces that are not collapsed, those of one edge one after the other: by
/// vertices, then by faces.
std::vector<HalfEdge> half_edges(const std::vector<std::array<uint32_t, 3>>& faces);

/// Calls `visit` with the half edges of each edge.
template <typename Visit>
void for_each_edge(std::span<const HalfEdge> sorted, const Visit& visit) {
  for (size_t i = 0; i < sorted.size();) {
    size_t end = i + 1;
    while (end < sorted.size() && sorted[end].low == sorted[i].low &&
           sorted[end].high == sorted[i].high)
      ++end;
    visit(sorted.subspan(i, end - i));
    i = end;
  }
}

constexpr uint32_t kNoFace = ~uint32_t{0};

struct FaceNeighbor {
  uint32_t face = kNoFace;
  bool consistent = true;  ///< they run along their edge in opposite directions, as winding asks
};

/// The faces beyond the sides of each face that it shares with exactly one other face.
class FaceNeighbors {
 public:
  explicit FaceNeighbors(size_t faces) : neighbors_(faces) {}
  void join(const HalfEdge& a, const HalfEdge& b) {
    const bool consistent = a.forward != b.forward;
    add(a.face, {b.face, consistent});
    add(b.face, {a.face, consistent});
  }
  /// Places that are not used hold kNoFace.
  const std::array<FaceNeighbor, 3>& of(uint32_t face) const { return neighbors_[face]; }

 private:
  void add(uint32_t face, const FaceNeighbor& neighbor) {
    for (FaceNeighbor& slot : neighbors_[face]) {
      if (slot.face != kNoFace) continue;
      slot = neighbor;
      return;
    }
  }
  std::vector<std::array<FaceNeighbor, 3>> neighbors_;
};

}  // namespace sightline::geometry
