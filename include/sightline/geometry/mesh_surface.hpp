// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/mesh.hpp"

namespace sightline {

/// A triangle with what a modeller painted on it. Corners in the object's frame [m].
struct SurfaceTriangle {
  std::array<Eigen::Vector3f, 3> corners;
  std::array<Eigen::Vector2f, 3> places;            ///< in the texture: x right, y up, 0..1
  Eigen::Vector3f color = Eigen::Vector3f::Zero();  ///< 0..1 RGB, as the file says
  /// The same, corner by corner, where the file has colors of vertices; else three times it.
  std::array<Eigen::Vector3f, 3> corner_colors;
  int texture = -1;  ///< into textures; -1: plain
};

/// The colors of a mesh file; empty where it has none.
struct MeshSurface {
  std::vector<SurfaceTriangle> triangles;
  /// Images beside the mesh (in its folder or below), not checked to be any.
  std::vector<std::filesystem::path> textures;
  /// For each of them its bytes where the mesh file itself holds it (glTF), under a made-up path;
  /// else empty.
  std::vector<std::string> embedded;
};

/// Reads materials, vertex colors and texture coordinates of a mesh that read_mesh() accepts.
/// Faces with more than four corners are cut as a fan.
Result<MeshSurface> read_mesh_surface(const std::filesystem::path& path,
                                      const MeshOptions& options = {});

}  // namespace sightline
