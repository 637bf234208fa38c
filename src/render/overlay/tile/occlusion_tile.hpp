// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/occlusion_depth.hpp"
#include "sightline/render/raster/tile.hpp"

namespace sightline {

/// The pixels that the cells of `hidden` cover and `beyond_px` around them, inside an image of
/// even size.
TileRect rect_around(const OcclusionDepth& hidden, int beyond_px, int width, int height);

/// Puts what was learned into a tile: at each pixel the nearer one stays.
void add_occlusion_depth(const OcclusionDepth& hidden, RasterTile& tile);

}  // namespace sightline
