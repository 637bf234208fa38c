// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// A texture in Y'CbCr (BT.601, limited range), with smaller copies of it, so that what is far away
/// does not shimmer (Williams, Pyramidal Parametrics, 1983). Immutable; any number of threads.
class SurfaceTexture {
 public:
  /// Larger images are taken at half their size, again and again.
  static constexpr int kMaxPixels = 2048;

  explicit SurfaceTexture(const I420View& image);

  /// One color in a word: y | u << 8 | v << 16.
  using Texel = uint32_t;
  struct Level {
    int width, height;
    std::vector<Texel> texels;  ///< row-major
  };
  /// From the largest, each half of the one before, down to one texel.
  const std::vector<Level>& levels() const { return levels_; }

 private:
  std::vector<Level> levels_;
};

/// Gives each face of the mesh its colors: those of the triangle of `surface` that lies where the
/// face does. `textures` stands beside surface.textures; null: one that cannot be read, whose
/// triangles keep their plain color. Does nothing if the surface is empty.
void paint_mesh(const MeshSurface& surface,
                std::vector<std::shared_ptr<const SurfaceTexture>> textures, RenderMesh& mesh);

}  // namespace sightline
