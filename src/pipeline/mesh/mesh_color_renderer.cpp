// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/mesh_color_renderer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pipeline/mesh/depth_tile.hpp"
#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/surface_shader.hpp"

namespace sightline {
namespace {

constexpr int kSidesAlong = 3;  // parts of each face of a cube of directions, along either edge

// On the faces of a cube, three by three each: sides of a box keep one, round things have many.
uint8_t side_of(const Eigen::Vector3d& normal) {
  Eigen::Index axis = 0;
  const double most = std::max(normal.cwiseAbs().maxCoeff(&axis), 1e-9);
  const auto part = [&](Eigen::Index other) {
    const double at = (normal[other] / most + 1) / 2 * kSidesAlong;
    return std::clamp(static_cast<int>(at), 0, kSidesAlong - 1);
  };
  const int face = 2 * static_cast<int>(axis) + (normal[axis] < 0 ? 1 : 0);
  return static_cast<uint8_t>((face * kSidesAlong + part((axis + 1) % 3)) * kSidesAlong +
                              part((axis + 2) % 3));
}

class MeshColorRenderer final : public ColorRenderer {
 public:
  MeshColorRenderer(std::shared_ptr<const RayTable> rays, std::shared_ptr<const RenderMesh> mesh)
      : rasterizer_(rays), shader_(std::move(rays)), mesh_(std::move(mesh)) {
    for (uint32_t f = 0; f < mesh_->faces.size(); ++f) sides_.push_back(side_of(mesh_->normal(f)));
  }

  ColorTile render(const Rigid3& camera_from_object) override {
    tile_.reset(rasterizer_.bounds(*mesh_, camera_from_object, 0), true);
    ColorTile out;
    if (tile_.rect().empty() || !rasterizer_.draw(*mesh_, camera_from_object, tile_)) return out;
    shader_.run(*mesh_, camera_from_object, Shading::kFlat, true, tile_);
    out.depth = pipeline::depth_tile(tile_, rasterizer_.rays().model());
    const size_t size = tile_.stride() * static_cast<size_t>(tile_.height());
    for (auto& plane : planes_) {
      if (plane.size() < size) plane.resize(size);
    }
    for (int y = 0; y < tile_.height(); ++y) take_row(y);
    out.color = {planes_[0].data(), planes_[1].data(), planes_[2].data()};
    out.side = planes_[3].data();
    out.stride = static_cast<ptrdiff_t>(tile_.stride());
    return out;
  }

 private:
  // The shader's light is taken out of its colors.
  void take_row(int y) {
    const uint32_t* const faces = tile_.face(y);
    const uint8_t* const shade = tile_.shade(y);
    const std::array<const uint8_t*, 3> lit = {shader_.luma(y), shader_.u(y), shader_.v(y)};
    const size_t row = static_cast<size_t>(y) * tile_.stride();
    for (int x = 0; x < tile_.width(); ++x) {
      if (faces[x] == RasterTile::kNoFace) continue;
      const int light = SurfaceShader::light_of(shade[x]);
      const size_t at = row + static_cast<size_t>(x);
      for (size_t c = 0; c < 3; ++c) {
        const int rest = SurfaceShader::kUnlit[c];
        planes_[c][at] =
            static_cast<uint8_t>(std::clamp(rest + (lit[c][x] - rest) * 256 / light, 0, 255));
      }
      planes_[3][at] = sides_[faces[x]];
    }
  }

  MeshRasterizer rasterizer_;
  SurfaceShader shader_;
  std::shared_ptr<const RenderMesh> mesh_;
  std::vector<uint8_t> sides_;  ///< by face
  RasterTile tile_;
  std::array<std::vector<uint8_t>, 4> planes_;  ///< Y, U, V, side
};

}  // namespace

ColorRendererFactory mesh_color_renderer_factory(std::shared_ptr<const RenderMesh> painted,
                                                 std::shared_ptr<const CameraGeometry> camera) {
  return [painted = std::move(painted),
          camera = std::move(camera)](const CameraModel& model) -> std::unique_ptr<ColorRenderer> {
    auto rays = camera ? camera->rays(model) : RayTable::build(model);
    return std::make_unique<MeshColorRenderer>(std::move(rays), painted);
  };
}

}  // namespace sightline
