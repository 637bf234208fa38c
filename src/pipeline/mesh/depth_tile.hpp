// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/render/raster/raster.hpp"

namespace sightline::pipeline {

/// What was drawn, as those who observe see it; width 0 if nothing was. Borrows the tile's memory.
inline DepthTile depth_tile(const RasterTile& tile, const CameraModel& camera) {
  DepthTile out;
  if (tile.rect().empty()) return out;
  out.x = tile.rect().x;
  out.y = tile.rect().y;
  // A tile may reach past an image of odd size.
  out.width = std::min(tile.width(), camera.width() - out.x);
  out.height = std::min(tile.height(), camera.height() - out.y);
  out.stride = static_cast<ptrdiff_t>(tile.stride());
  out.data = tile.inverse_depth(0);
  return out;
}

}  // namespace sightline::pipeline
