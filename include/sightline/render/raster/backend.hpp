// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/raster/tile.hpp"

namespace sightline {

/// One renderer interface: the CPU rasterizer and a GPU one draw the same pixels behind it. A
/// backend belongs to one camera and one thread.
class RasterBackend {
 public:
  virtual ~RasterBackend() = default;
  virtual std::string_view name() const = 0;

  /// The part of the frame that the mesh can touch, grown by `margin_px` on all sides, with even
  /// corner and size, clipped to the frame. Empty if no pixel can show it.
  virtual TileRect bounds(const RenderMesh& mesh, const Rigid3& camera_from_object,
                          int margin_px) const = 0;

  /// Draws the mesh into the tile on top of what is there, nearest surface first. Pixels nearer
  /// than kNearPlane are not drawn. The caller has reset() the tile.
  virtual Status draw(const RenderMesh& mesh, const Rigid3& camera_from_object,
                      RasterTile& tile) = 0;
};

/// Surfaces nearer to the camera's plane than this are cut away [m].
inline constexpr double kNearPlane = 1e-3;

/// The light of the shade plane: direction towards it in the camera's frame (unit), from above left
/// behind the camera; shade = 255 * luminance * (kAmbient + (1 - kAmbient) * max(0, normal .
/// light)).
inline constexpr double kLightX = -0.30, kLightY = -0.45, kLightZ = -0.8411301923630;
inline constexpr double kAmbient = 0.25;

}  // namespace sightline
