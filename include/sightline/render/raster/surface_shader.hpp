// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "sightline/render/mesh/mesh_paint.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/mesh/shading.hpp"
#include "sightline/render/raster/ray_table.hpp"
#include "sightline/render/raster/tile.hpp"

namespace sightline {

/// The color of a texture at a place, over a parallelogram of it that a pixel shows. `across` and
/// `down` are its sides (one pixel's step right and down), in shares of the texture, as `place` is.
/// Trilinear between the copies of the texture; a long footprint is read at up to four places.
SurfaceTexture::Texel sample_texture(const SurfaceTexture& texture, const Eigen::Vector2f& place,
                                     const Eigen::Vector2f& across, const Eigen::Vector2f& down);

/// Shades a tile whose rasterizer numbered the faces, the CPU's or a GPU's alike: each pixel's ray
/// meets the plane of its face, which gives the weights of the corners exactly, through any lens
/// and in perspective (Olano and Greer, Triangle Scan Conversion using 2D Homogeneous Coordinates,
/// 1997). Belongs to one camera and one thread; nothing allocates once the largest tile has been.
class SurfaceShader {
 public:
  explicit SurfaceShader(std::shared_ptr<const RayTable> rays);

  /// Fills tile.shade() where a face is. `textured`: also luma() and so on, the mesh's own colors
  /// under the light; the mesh has paint.
  void run(const RenderMesh& mesh, const Rigid3& camera_from_object, Shading shading, bool textured,
           RasterTile& tile);

  /// What light makes of a color by a pixel's shade: kUnlit + (color - kUnlit) * light / 256.
  static constexpr int light_of(uint8_t shade) { return 80 + (175 * shade >> 8); }
  static constexpr std::array<int, 3> kUnlit = {16, 128, 128};  ///< Y, U, V

  /// Lit colors of the tile's row `y`, after a textured run; without meaning where no face is.
  const uint8_t* luma(int y) const { return planes_[0].data() + row(y); }
  const uint8_t* u(int y) const { return planes_[1].data() + row(y); }
  const uint8_t* v(int y) const { return planes_[2].data() + row(y); }

 private:
  /// A linear function of the ray, counted from an origin near the face: a dx + b dy + c.
  struct Linear {
    float a = 0, b = 0, c = 0;
    float at(float dx, float dy) const { return a * dx + b * dy + c; }
  };
  /// What pixels of a face need. Of a corner value k the value at a ray is k.at() / weight.at().
  struct Face {
    uint32_t number = RasterTile::kNoFace;
    float origin_x = 0, origin_y = 0;
    Linear weight;
    float flat = 0;  ///< Lambert of the face
    float luminance = 0;
    std::array<Linear, 3> normal;  ///< smooth
    Linear towards;                ///< normal . light
    const SurfaceTexture* texture = nullptr;
    std::array<Linear, 3> colors;  ///< of the corners, or place x, y
  };
  struct View;
  void set_up(const View& view, uint32_t number, float ray_x, float ray_y, Face& face) const;
  static float lambert_at(const Face& face, bool smooth, float dx, float dy);
  static SurfaceTexture::Texel color_at(const Face& face, float dx, float dy,
                                        const Eigen::Vector2f& right, const Eigen::Vector2f& down);
  void shade_row(const View& view, int y, RasterTile& tile);
  void repeat_frame_edge(const TileRect& rect);
  size_t row(int y) const { return static_cast<size_t>(y) * stride_; }

  static constexpr size_t kKept = 512;

  const std::shared_ptr<const RayTable> rays_;
  std::vector<Face> faces_;  ///< the last ones seen, by number modulo kKept
  std::array<std::vector<uint8_t>, 3> planes_;
  size_t stride_ = 0;
};

}  // namespace sightline
