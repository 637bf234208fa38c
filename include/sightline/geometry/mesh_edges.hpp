// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "sightline/geometry/mesh.hpp"

namespace sightline {

/// An edge of a mesh that shows as a line: vertices and the faces beside it (the same one twice at
/// a border).
struct MeshEdge {
  uint32_t start, end;
  uint32_t first_face, second_face;
  Eigen::Vector3f tangent;  ///< unit, of the line that shows; from start to end, about
};

/// Borders, edges of more than two faces, and creases: edges whose faces meet at more than
/// `crease_angle` [rad]. A scan's noise tilts small faces. So the mean normals of the surface to
/// either side, as far as 4 % of the bounding sphere's radius, are compared as well: where a fifth
/// of all creases (by length) are none by these, the others remain, and their tangent is where the
/// two sides meet. Vertices at the same place count as one; edges in the order of their vertices.
std::vector<MeshEdge> feature_edges(const TriangleMesh& mesh, double crease_angle);

}  // namespace sightline
