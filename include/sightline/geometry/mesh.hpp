// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

/// Triangles with one normal per corner. Outward faces turn counter-clockwise seen from outside.
/// Checked when made: finite, indices in range, at least one face, sane extent.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices;              ///< [m], in the object's frame
  std::vector<Eigen::Vector3f> normals;               ///< unit
  std::vector<std::array<uint32_t, 3>> faces;         ///< into vertices
  std::vector<std::array<uint32_t, 3>> face_normals;  ///< into normals, one per corner of a face
  std::vector<Eigen::Vector3f> face_colors;           ///< empty, or one 0..1 RGB per face
  Eigen::Vector3f min_corner = Eigen::Vector3f::Zero();
  Eigen::Vector3f max_corner = Eigen::Vector3f::Zero();
  Eigen::Vector3f center = Eigen::Vector3f::Zero();  ///< of the bounding sphere
  float radius = 0;                                  ///< of the bounding sphere [m]
  bool closed = false;  ///< every edge belongs to exactly two faces of opposite direction
                        ///< (as read, before faces without area were dropped)
};

struct MeshOptions {
  double meters_per_unit = 1.0;
  double max_extent = 1000.0;  ///< [m]; larger (or below 1e-6 m) is refused as a unit mistake
  size_t max_faces = 20'000'000;
  float crease_angle = 0.6f;  ///< [rad]; normals made here are smooth below it
};

/// Reads OBJ, PLY, STL, glTF/GLB and OFF (assimp) and 3VN (own reader), by extension. n-gons are
/// triangulated, missing normals made. Errors name file and line or element.
Result<TriangleMesh> read_mesh(const std::filesystem::path& path, const MeshOptions& options = {});

/// The same from memory; `format` is the extension without dot ("obj", "3vn", ...). `where` names
/// the file in errors. Companion files (OBJ materials) are found only by read_mesh().
Result<TriangleMesh> parse_mesh(std::string_view content, const std::string& format,
                                const std::string& where, const MeshOptions& options = {});

/// 3VN from memory: first line "VERTICES NORMALS FACES", then the vertices, the normals, and one
/// line per face: N, then N vertex indices and N normal indices (see docs/formats.md).
Result<TriangleMesh> parse_3vn(std::string_view text, const std::string& where,
                               const MeshOptions& options = {});

/// Applies the unit, merges vertices at the same place, drops vertices no face uses and faces
/// without area, fills normals (where empty), bounds and `closed`, and checks the rest. The order
/// of vertices and faces stays. Used by all readers and by programs that make meshes.
Result<TriangleMesh> finish_mesh(TriangleMesh mesh, const std::string& where,
                                 const MeshOptions& options = {});

/// Axis-aligned box centered at the origin, outward faces; sides in meters. For tests and examples.
TriangleMesh make_box(const Eigen::Vector3f& size);
/// Closed torus about z whose tube is bumpy, of about `faces` triangles (at least 32), fitting a
/// sphere of `radius` [m]. Not convex. For tests and benchmarks.
TriangleMesh make_bumpy_torus(size_t faces, float radius);

}  // namespace sightline
