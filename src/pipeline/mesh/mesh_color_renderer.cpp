// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/mesh_color_renderer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pipeline/mesh/depth_tile.hpp"
#include "pipeline/mesh/painted_raster.hpp"
#include "pipeline/mesh/renderer_factory.hpp"

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
  MeshColorRenderer(const std::shared_ptr<const RayTable>& rays,
                    std::shared_ptr<const RenderMesh> painted)
      : raster_(rays, std::move(painted)) {
    const RenderMesh& mesh = raster_.mesh();
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) sides_.push_back(side_of(mesh.normal(f)));
  }

  ColorTile render(const Rigid3& camera_from_object) override {
    ColorTile out;
    if (!raster_.draw(camera_from_object)) return out;
    const RasterTile& tile = raster_.tile();
    out.depth = pipeline::depth_tile(tile, raster_.camera());
    const size_t size = tile.stride() * static_cast<size_t>(tile.height());
    for (auto& plane : planes_) {
      if (plane.size() < size) plane.resize(size);
    }
    for (int y = 0; y < tile.height(); ++y) take_row(y);
    out.color = {planes_[0].data(), planes_[1].data(), planes_[2].data()};
    out.side = planes_[3].data();
    out.stride = static_cast<ptrdiff_t>(tile.stride());
    return out;
  }

 private:
  // The shader's light is taken out of its colors.
  void take_row(int y) {
    const RasterTile& tile = raster_.tile();
    const SurfaceShader& shader = raster_.shader();
    const uint32_t* const faces = tile.face(y);
    const uint8_t* const shade = tile.shade(y);
    const std::array<const uint8_t*, 3> lit = {shader.luma(y), shader.u(y), shader.v(y)};
    const size_t row = static_cast<size_t>(y) * tile.stride();
    for (int x = 0; x < tile.width(); ++x) {
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

  pipeline::PaintedRaster raster_;
  std::vector<uint8_t> sides_;                  ///< by face
  std::array<std::vector<uint8_t>, 4> planes_;  ///< Y, U, V, side
};

}  // namespace

ColorRendererFactory mesh_color_renderer_factory(std::shared_ptr<const RenderMesh> painted,
                                                 std::shared_ptr<const CameraGeometry> camera) {
  return pipeline::renderer_factory<ColorRenderer, MeshColorRenderer>(std::move(painted),
                                                                      std::move(camera));
}

}  // namespace sightline
