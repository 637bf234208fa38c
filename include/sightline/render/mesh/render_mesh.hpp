// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "sightline/geometry/mesh.hpp"
#include "sightline/render/mesh/color.hpp"

namespace sightline {

class SurfaceTexture;

/// An edge that is drawn in a wireframe: a crease, or the border of an open mesh.
struct FeatureEdge {
  uint32_t start = 0, end = 0;               ///< into the vertices
  uint32_t first_face = 0, second_face = 0;  ///< into the faces; equal for a border edge
};

/// The colors of a face, corner by corner.
struct FacePaint {
  std::array<Eigen::Vector2f, 3> places;  ///< in the texture: 0..1, x right, y down; may repeat
  std::array<Yuv, 3> colors;              ///< where there is no texture
  int32_t texture = -1;                   ///< into RenderMesh::textures; -1: none
};

struct RenderMeshOptions {
  float crease_angle = 0.6f;  ///< [rad] between face normals; edges bent more are feature edges
  bool two_sided = false;     ///< draw back faces although the mesh is closed
};

/// A mesh prepared for the rasterizers: made once per object, then read by any number of threads.
/// Object frame, meters. Faces without area are left out.
struct RenderMesh {
  std::vector<float> x, y, z;                  ///< vertices
  std::vector<std::array<uint32_t, 3>> faces;  ///< counter-clockwise seen from outside
  /// Plane of each face: normal . p = offset, unit outward normal.
  std::vector<float> normal_x, normal_y, normal_z, offset;
  std::vector<float> luminance;  ///< per face 0..1 (BT.601 weights; 0.8 without colors)
  std::vector<FeatureEdge> feature_edges;
  /// For smooth shading, one per corner of a face: those of the mesh file, or made with the crease
  /// angle. Empty: none.
  std::vector<Eigen::Vector3f> corner_normals;               ///< unit
  std::vector<std::array<uint32_t, 3>> face_corner_normals;  ///< into corner_normals
  /// One per face, if the mesh has colors and paint_mesh() was told of them.
  std::vector<FacePaint> paint;
  std::vector<std::shared_ptr<const SurfaceTexture>> textures;
  Eigen::Vector3f min_corner = Eigen::Vector3f::Zero();
  Eigen::Vector3f max_corner = Eigen::Vector3f::Zero();
  Eigen::Vector3f center = Eigen::Vector3f::Zero();  ///< of the bounding sphere
  float radius = 0;                                  ///< of the bounding sphere
  float crease_angle = 0;                            ///< that it was made with [rad]
  bool cull_back_faces = false;                      ///< closed, and not asked to be two-sided
  uint64_t serial = 0;  ///< of the mesh in this process, for copies of it on a GPU

  size_t vertex_count() const { return x.size(); }
  Eigen::Vector3d vertex(uint32_t i) const { return {x[i], y[i], z[i]}; }
  Eigen::Vector3d normal(uint32_t f) const { return {normal_x[f], normal_y[f], normal_z[f]}; }
};

/// Prepares a checked mesh. Vertices at equal positions are joined, so creases do not depend on how
/// the file splits them.
RenderMesh make_render_mesh(const TriangleMesh& mesh, const RenderMeshOptions& options = {});

}  // namespace sightline
