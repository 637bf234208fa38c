// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/mesh_print_renderer.hpp"

#include "pipeline/mesh/depth_tile.hpp"
#include "pipeline/mesh/painted_raster.hpp"
#include "pipeline/mesh/renderer_factory.hpp"

namespace sightline {
namespace {

class MeshPrintRenderer final : public PrintRenderer {
 public:
  MeshPrintRenderer(const std::shared_ptr<const RayTable>& rays,
                    std::shared_ptr<const RenderMesh> mesh)
      : raster_(rays, std::move(mesh)) {}

  PrintTile render(const Rigid3& camera_from_object) override {
    PrintTile out;
    if (!raster_.draw(camera_from_object)) return out;
    const SurfaceShader& shader = raster_.shader();
    out.depth = pipeline::depth_tile(raster_.tile(), raster_.camera());
    out.luma = shader.luma(0);
    out.luma_stride = shader.luma(1) - shader.luma(0);
    return out;
  }

 private:
  pipeline::PaintedRaster raster_;
};

}  // namespace

PrintRendererFactory mesh_print_renderer_factory(std::shared_ptr<const RenderMesh> painted,
                                                 std::shared_ptr<const CameraGeometry> camera) {
  return pipeline::renderer_factory<PrintRenderer, MeshPrintRenderer>(std::move(painted),
                                                                      std::move(camera));
}

}  // namespace sightline
