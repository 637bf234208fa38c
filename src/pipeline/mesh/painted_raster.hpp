// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>

#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/surface_shader.hpp"

namespace sightline::pipeline {

/// A mesh with its colors, drawn by the CPU rasterizer and shader, again and again.
class PaintedRaster {
 public:
  PaintedRaster(const std::shared_ptr<const RayTable>& rays, std::shared_ptr<const RenderMesh> mesh)
      : rasterizer_(rays), shader_(rays), mesh_(std::move(mesh)) {}

  /// False: nothing of it is in the image.
  bool draw(const Rigid3& camera_from_object) {
    tile_.reset(rasterizer_.bounds(*mesh_, camera_from_object, 0), true);
    if (tile_.rect().empty() || !rasterizer_.draw(*mesh_, camera_from_object, tile_)) return false;
    shader_.run(*mesh_, camera_from_object, Shading::kFlat, true, tile_);
    return true;
  }
  // What was drawn last.
  const RasterTile& tile() const { return tile_; }
  const SurfaceShader& shader() const { return shader_; }
  const CameraModel& camera() const { return rasterizer_.rays().model(); }
  const RenderMesh& mesh() const { return *mesh_; }

 private:
  MeshRasterizer rasterizer_;
  SurfaceShader shader_;
  std::shared_ptr<const RenderMesh> mesh_;
  RasterTile tile_;
};

}  // namespace sightline::pipeline
