// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/mesh_surface.hpp"

namespace sightline::geometry {

/// A polygon with more corners than this is refused: no modeller writes it, and cutting it into
/// triangles takes the square of the number.
constexpr size_t kMaxCorners = 1000;

/// What the readers make: faces of any number of corners, in the file's unit.
struct PolygonMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;   ///< may be empty
  std::vector<uint32_t> corner_vertices;  ///< of all faces, one after the other
  std::vector<uint32_t> corner_normals;   ///< likewise, or empty
  std::vector<uint32_t> corner_counts;    ///< one per face
  std::vector<Eigen::Vector3f> face_colors;
};

/// Cuts the polygons into triangles and finishes the mesh. Indices must be in range.
Result<TriangleMesh> triangulate_polygons(const PolygonMesh& polygons, const std::string& where,
                                          const MeshOptions& options);

/// Cuts one polygon, possibly concave but planar and without self-intersection, into its n - 2
/// triangles by clipping ears (Meisters 1975). Appends indices into `corners`.
void clip_ears(const std::vector<Eigen::Vector3f>& corners,
               std::vector<std::array<uint32_t, 3>>* triangles);

/// The formats read by assimp. `directory` is where companion files may lie; empty for none.
Result<TriangleMesh> import_mesh(std::string_view content, const std::string& format,
                                 const std::string& where, const std::filesystem::path& directory,
                                 const MeshOptions& options);

/// What read_mesh_surface() returns, of the formats read by assimp.
Result<MeshSurface> import_surface(std::string_view content, const std::string& format,
                                   const std::string& where, const std::filesystem::path& directory,
                                   const MeshOptions& options);

/// Normals of a welded mesh: at each corner the mean, by corner angle, of the faces around the
/// vertex that are within the crease angle of the corner's own face.
void make_normals(TriangleMesh* mesh, float crease_angle);

}  // namespace sightline::geometry
