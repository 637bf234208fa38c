// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/overlay/tile/tile_kernels.hpp"
#include "sightline/image/blend.hpp"
#include "sightline/render/overlay/overlay_style.hpp"
#include "sightline/render/raster/static_depth.hpp"
#include "sightline/render/raster/tile.hpp"

namespace sightline {

class SurfaceShader;

/// How a tile is painted.
struct TilePaint {
  Yuv color;                  ///< the visible part
  Yuv xray_color;             ///< the part behind the static scene
  float fill_opacity = 0;     ///< 0: no fill
  float outline_px = 0;       ///< 0: no outline
  bool dashed = false;        ///< outline in dashes everywhere, not only behind the scene
  float halo_opacity = 0.5f;  ///< of the dark rim, as beside lines
};

/// The scene hides what has 1/z smaller than its own by this factor. The tolerance is a share of
/// the range and so many standard deviations of the object's position, so that the border between
/// seen and hidden keeps still while the pose is uncertain.
float hide_factor(double tolerance, double sigmas, double sigma_translation, double depth);

/// What the tile shows, in frame pixels.
struct TileCoverage {
  TileRect bounds;      ///< of the covered pixels, exact (not made even); empty if none
  bool hidden = false;  ///< the scene hides some of it
};

/// Turns a raster tile into a premultiplied YUV tile: shaded fill, soft outline with a dark halo
/// and, where the static scene is nearer, hatched fill and dashed outline in another hue. Keeps its
/// memory between frames. Used by one thread.
class TileCompositor {
 public:
  /// Pixels around the mesh that the outline and its halo need.
  static constexpr int kMargin = 4;

  TileCompositor(int frame_width, int frame_height);

  /// Splits the tile into visible and hidden pixels: hidden where the scene's 1/z is more than
  /// `factor` times the object's. `scene` may be null.
  TileCoverage classify(const RasterTile& tile, const StaticDepth* scene, float factor);
  /// The same with what hides the object in a tile of the same place and size.
  TileCoverage classify(const RasterTile& tile, const RasterTile& occluders, float factor);

  /// Paints the tile classified last. The view is valid until the next call.
  /// `own` gives the visible part of the fill its colors; null: paint.color under tile.shade().
  OverlayTileView compose(const RasterTile& tile, const TilePaint& paint,
                          const SurfaceShader* own = nullptr);

  /// Of a frame pixel, in the tile classified last.
  enum class PixelClass : uint8_t { kEmpty, kVisible, kHidden };
  PixelClass pixel_class(int x, int y) const;

  bool any_hidden() const { return coverage_.hidden; }
  /// True if the scene hides the object at this frame pixel or one beside it (of the tile
  /// classified last).
  bool hidden_near(int x, int y) const;

 private:
  template <typename OccluderRow>
  TileCoverage classify_rows(const RasterTile& tile, float factor, const OccluderRow& occluder_row);
  size_t at(int x, int y) const {
    return static_cast<size_t>(y) * stride_ + static_cast<size_t>(x);
  }
  void reserve(const TileRect& rect);
  void repeat_frame_edge();
  TileRect painted_part() const;
  /// Columns of tile pixels, end excluded.
  struct Columns {
    int first = 0, end = 0;
    int count() const { return end - first; }
  };
  tile::CoveredSpan covered_columns(int y) const;
  Columns painted_columns(int y, const TileRect& part) const;
  std::array<Columns, 2> deep_inside(int y) const;
  void clear_beside(int y, const TileRect& part, const Columns& painted);
  /// `rows`: where the seven rows begin that blur into this one.
  void blur(const std::vector<uint8_t>& plane, const std::array<size_t, 7>& rows,
            const Columns& columns, const std::array<Columns, 2>& inside,
            std::vector<uint8_t>& out);
  tile::InkStyle ink_style_of(const TilePaint& paint) const;
  void fill_hatch(float fill_opacity);
  void compose_chroma(int y, const Columns& columns, const TilePaint& paint,
                      const SurfaceShader* own);
  OverlayTileView view_of(const TileRect& part) const;

  int frame_width_, frame_height_;
  const tile::Kernels* kernels_;
  TileRect rect_;
  size_t stride_ = 0;
  TileCoverage coverage_;
  TileRect inner_;  ///< coverage_.bounds in tile coordinates

  std::vector<uint8_t> mask_, hidden_, columns_;
  std::vector<uint16_t> column_sums_;
  std::vector<tile::CoveredSpan> covered_;  ///< of each row of the tile
  std::vector<uint8_t> blurred_, blurred_hidden_, hatch_;
  std::array<std::vector<uint8_t>, 2> visible_ink_, xray_ink_, own_ink_;
  std::vector<uint8_t> luma_, alpha_, u_, v_, chroma_alpha_;
};

}  // namespace sightline
