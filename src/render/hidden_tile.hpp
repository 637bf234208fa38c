// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/hidden_depth.hpp"
#include "sightline/render/tile.hpp"

namespace sightline {

/// The pixels that the cells of `hidden` cover and `beyond_px` around them, inside a picture of
/// even size.
TileRect rect_around(const HiddenDepth& hidden, int beyond_px, int width, int height);

/// Puts what was learned into a tile: at each pixel the nearer one stays.
void add_hidden_depth(const HiddenDepth& hidden, RasterTile& tile);

}  // namespace sightline
