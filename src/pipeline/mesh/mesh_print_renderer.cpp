// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/mesh_print_renderer.hpp"

#include "pipeline/mesh/depth_tile.hpp"
#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/surface_shader.hpp"

namespace sightline {
namespace {

class MeshPrintRenderer final : public PrintRenderer {
 public:
  MeshPrintRenderer(std::shared_ptr<const RayTable> rays, std::shared_ptr<const RenderMesh> mesh)
      : rasterizer_(rays), shader_(std::move(rays)), mesh_(std::move(mesh)) {}

  PrintTile render(const Rigid3& camera_from_object) override {
    tile_.reset(rasterizer_.bounds(*mesh_, camera_from_object, 0), true);
    PrintTile out;
    if (tile_.rect().empty() || !rasterizer_.draw(*mesh_, camera_from_object, tile_)) return out;
    shader_.run(*mesh_, camera_from_object, Shading::kFlat, true, tile_);
    out.depth = pipeline::depth_tile(tile_, rasterizer_.rays().model());
    out.luma = shader_.luma(0);
    out.luma_stride = shader_.luma(1) - shader_.luma(0);
    return out;
  }

 private:
  MeshRasterizer rasterizer_;
  SurfaceShader shader_;
  std::shared_ptr<const RenderMesh> mesh_;
  RasterTile tile_;
};

}  // namespace

PrintRendererFactory mesh_print_renderer_factory(std::shared_ptr<const RenderMesh> painted,
                                                 std::shared_ptr<const CameraGeometry> camera) {
  return [painted = std::move(painted),
          camera = std::move(camera)](const CameraModel& model) -> std::unique_ptr<PrintRenderer> {
    auto rays = camera ? camera->rays(model) : RayTable::build(model);
    return std::make_unique<MeshPrintRenderer>(std::move(rays), painted);
  };
}

}  // namespace sightline
