// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "sightline/geometry/rigid3.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/raster/ray_table.hpp"
#include "sightline/render/raster/tile.hpp"

namespace sightline {

class MeshRasterizer;

/// A mesh of the scene that does not move.
struct SceneMesh {
  const RenderMesh* mesh = nullptr;
  Rigid3 world_from_mesh;
};

/// Inverse depth of the static scene at every pixel of one camera, rendered once per calibration.
/// An object is hidden at a pixel where its 1/z is smaller by more than the caller's tolerance.
/// Immutable; any number of threads.
class StaticDepth {
 public:
  /// Full-frame raster of all meshes; milliseconds. `depth` adds what was measured: one number a
  /// pixel of the camera, row-major, along its axis [m], 0 where there is no surface; empty: none.
  /// The nearest surface counts.
  static std::shared_ptr<const StaticDepth> build(const std::shared_ptr<const RayTable>& rays,
                                                  const Rigid3& world_from_camera,
                                                  std::span<const SceneMesh> meshes,
                                                  std::span<const float> depth = {});

  /// True if no pixel shows a static surface: nothing needs comparing.
  bool empty() const { return empty_; }
  int width() const { return tile_.width(); }
  int height() const { return tile_.height(); }
  /// Row of the frame: 1/z [1/m] in this camera, 0 where there is no surface.
  const float* row(int y) const { return tile_.inverse_depth(y); }
  /// The whole frame as a tile, for project_line().
  const RasterTile& tile() const { return tile_; }

 private:
  friend class TurningDepth;
  StaticDepth() = default;
  void draw(MeshRasterizer& rasterizer, const RayTable& rays, const Rigid3& world_from_camera,
            std::span<const SceneMesh> meshes, std::span<const float> depth);

  RasterTile tile_;
  bool empty_ = true;
};

}  // namespace sightline
