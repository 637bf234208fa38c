// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/mesh_depth_renderer.hpp"

#include "pipeline/mesh/depth_tile.hpp"
#include "pipeline/mesh/renderer_factory.hpp"
#include "sightline/render/raster/raster.hpp"

namespace sightline {
namespace {

class MeshDepthRenderer final : public DepthRenderer {
 public:
  MeshDepthRenderer(std::shared_ptr<const RayTable> rays, std::shared_ptr<const RenderMesh> mesh)
      : rasterizer_(std::move(rays)), mesh_(std::move(mesh)) {}

  const CameraModel& camera() const override { return rasterizer_.rays().model(); }

  DepthTile render(const Rigid3& camera_from_object) override {
    rasterizer_.render(*mesh_, camera_from_object, 0, tile_);
    return pipeline::depth_tile(tile_, camera());
  }

 private:
  MeshRasterizer rasterizer_;
  std::shared_ptr<const RenderMesh> mesh_;
  RasterTile tile_;
};

}  // namespace

DepthRendererFactory mesh_depth_renderer_factory(std::shared_ptr<const RenderMesh> mesh,
                                                 std::shared_ptr<const CameraGeometry> camera) {
  return pipeline::renderer_factory<DepthRenderer, MeshDepthRenderer>(std::move(mesh),
                                                                      std::move(camera));
}

}  // namespace sightline
