// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/mesh_surface.hpp"

namespace sightline::geometry {

/// What has to be done to a face of a file.
enum class FaceRepair : uint8_t {
  kKeep,
  kReverse,  ///< its corners run the other way round than its neighbors', or inward
  kDrop      ///< another face has the same corners: a sheet that is modeled from both sides
};

/// How the triangles of a file become a surface whose neighboring faces share vertices and run the
/// same way round, outward where it is closed.
struct MeshRepair {
  std::vector<uint32_t> vertices;  ///< for each vertex the one that stands for its place
  std::vector<FaceRepair> faces;
};

/// Vertices within 1e-5 of the extent of one another (and a twentieth of a short edge) are one
/// place. Of two faces that run along
/// their edge in the same direction one is reversed; of what hangs together so, the sign of its
/// volume says which side is outside where it is closed or nearly so, and the larger area keeps its
/// direction where it is not. What has only one side (Moebius) stays as it is. Indices must be in
/// range.
MeshRepair find_mesh_repair(const std::vector<Eigen::Vector3f>& vertices,
                            const std::vector<std::array<uint32_t, 3>>& faces);

/// Does it, before finish_mesh(). Given normals of faces that are reversed point the other way
/// where they would look inward.
void repair_mesh(TriangleMesh* mesh);

/// The same for the triangles of a surface; corners stay where they are.
void repair_surface(MeshSurface* surface);

}  // namespace sightline::geometry
