// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// The part of a camera's image that one mesh touches: inverse depth 1/z [1/m] of the nearest
/// surface at each pixel center, 0 where there is none.
struct DepthTile {
  int x = 0, y = 0;           ///< top-left pixel of the tile in the image
  int width = 0, height = 0;  ///< 0: the mesh is out of sight
  ptrdiff_t stride = 0;       ///< floats from row to row
  const float* data = nullptr;

  const float* row(int tile_y) const { return data + tile_y * stride; }
  /// By image pixel; 0 outside the tile.
  float at(int px, int py) const {
    const int tx = px - x, ty = py - y;
    if (tx < 0 || ty < 0 || tx >= width || ty >= height) return 0;
    return row(ty)[tx];
  }
};

/// Seam from observe to render: draws one mesh as one camera sees it, through the exact lens. One
/// thread at a time.
class DepthRenderer {
 public:
  virtual ~DepthRenderer() = default;
  virtual const CameraModel& camera() const = 0;
  /// The tile is valid until the next call. Nothing allocates once the largest tile has been made.
  virtual DepthTile render(const Rigid3& camera_from_object) = 0;
};

/// Makes a renderer of one mesh for any camera; daemon/ and cli/ make the factory. Any thread.
using DepthRendererFactory = std::function<std::unique_ptr<DepthRenderer>(const CameraModel&)>;

/// The same of a mesh with textures, and what these look like there.
struct PrintTile {
  DepthTile depth;
  const uint8_t* luma = nullptr;  ///< at depth's pixels; without meaning where no surface is
  ptrdiff_t luma_stride = 0;      ///< bytes from row to row
};

/// As DepthRenderer, with the mesh's own textures.
class PrintRenderer {
 public:
  virtual ~PrintRenderer() = default;
  virtual PrintTile render(const Rigid3& camera_from_object) = 0;
};

using PrintRendererFactory = std::function<std::unique_ptr<PrintRenderer>(const CameraModel&)>;

/// What a mesh's own colors look like there, without light on them.
struct ColorTile {
  DepthTile depth;
  /// Y, U and V (BT.601, limited range) at depth's pixels; without meaning where no surface is.
  std::array<const uint8_t*, 3> color{};
  /// Which way the surface looks in the object's frame: about the same where it is equal.
  const uint8_t* side = nullptr;
  ptrdiff_t stride = 0;  ///< bytes from row to row of these planes
};

/// As DepthRenderer, with the mesh's materials, vertex colors and textures.
class ColorRenderer {
 public:
  virtual ~ColorRenderer() = default;
  virtual ColorTile render(const Rigid3& camera_from_object) = 0;
};

using ColorRendererFactory = std::function<std::unique_ptr<ColorRenderer>(const CameraModel&)>;

}  // namespace sightline
