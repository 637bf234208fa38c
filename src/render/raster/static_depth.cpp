// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/raster/static_depth.hpp"

#include <algorithm>

#include "sightline/base/check.hpp"
#include "sightline/render/raster/raster.hpp"

namespace sightline {
namespace {

void add_depth(const RayTable& rays, std::span<const float> depth, RasterTile& tile) {
  const auto width = static_cast<size_t>(rays.width());
  SL_CHECK(depth.size() == width * static_cast<size_t>(rays.height()), "depth of another size");
  for (int y = 0; y < rays.height(); ++y) {
    const float* const measured = depth.data() + static_cast<size_t>(y) * width;
    float* const row = tile.inverse_depth(y);
    for (size_t x = 0; x < width; ++x) {
      if (measured[x] > 0) row[x] = std::max(row[x], 1 / measured[x]);
    }
  }
}

}  // namespace

std::shared_ptr<const StaticDepth> StaticDepth::build(const std::shared_ptr<const RayTable>& rays,
                                                      const Rigid3& world_from_camera,
                                                      std::span<const SceneMesh> meshes,
                                                      std::span<const float> depth) {
  const std::shared_ptr<StaticDepth> scene(new StaticDepth);
  MeshRasterizer rasterizer(rays);
  scene->draw(rasterizer, *rays, world_from_camera, meshes, depth);
  return scene;
}

void StaticDepth::draw(MeshRasterizer& rasterizer, const RayTable& rays,
                       const Rigid3& world_from_camera, std::span<const SceneMesh> meshes,
                       std::span<const float> depth) {
  tile_.reset({0, 0, rays.even_width(), rays.even_height()});
  const Rigid3 camera_from_world = world_from_camera.inverse();
  for (const SceneMesh& part : meshes) {
    SL_CHECK(part.mesh != nullptr, "a scene mesh is set");
    const Status drawn =
        rasterizer.draw(*part.mesh, camera_from_world * part.world_from_mesh, tile_);
    SL_CHECK(drawn.has_value(), "the CPU rasterizer does not fail");
  }
  if (!depth.empty()) add_depth(rays, depth, tile_);
  empty_ = true;
  for (int y = 0; y < height() && empty_; ++y) {
    const float* const line = row(y);
    empty_ = std::all_of(line, line + width(), [](float z) { return z == 0; });
  }
}

}  // namespace sightline
