// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "render/overlay/frame_target.hpp"
#include "render/overlay/occluders.hpp"
#include "render/overlay/subject.hpp"
#include "render/overlay/tile/tile_compositor.hpp"
#include "sightline/render/gpu/raster_device.hpp"
#include "sightline/render/raster/surface_shader.hpp"

namespace sightline::render {

/// Fill and outline of objects: rasterized into a tile, compared with what hides them, composed and
/// blended. Keeps its memory between frames.
class SurfacePainter {
 public:
  SurfacePainter(std::shared_ptr<const RayTable> rays, std::shared_ptr<const RasterDevice> device);

  /// Whether a style asks for draw().
  static bool needed_by(const OverlayStyle& style);

  /// `all`: the frame's objects, for those that may hide this one. Empty if no pixel shows it.
  TileCoverage draw(const FrameTarget& target, const Subject& subject, std::span<const Subject> all,
                    Occluders& occluders);

  /// Of the object drawn last: its depth, and which of its pixels are hidden.
  const RasterTile& tile() const { return tile_; }
  const TileCompositor& compositor() const { return compositor_; }

 private:
  const std::shared_ptr<const RasterDevice> device_;
  const std::unique_ptr<RasterBackend> rasterizer_;
  RasterTile tile_;
  SurfaceShader shader_;
  TileCompositor compositor_;
};

}  // namespace sightline::render
