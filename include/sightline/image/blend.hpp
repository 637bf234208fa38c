// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/image/planes.hpp"

namespace sightline {

/// A small premultiplied YUV image to lay over a frame: planar, already in the frame's colors,
/// with full-size alpha for luma and quarter-size alpha for chroma. Color planes hold value *
/// alpha / 255. Blending: out = color + in * (255 - alpha) / 255, rounded.
struct OverlayTileView {
  int x = 0;  ///< top-left corner in the frame, even
  int y = 0;
  PlaneView luma, u, v;           ///< luma: w x h (even); u, v: w/2 x h/2
  PlaneView alpha, chroma_alpha;  ///< w x h; w/2 x h/2
};

/// Blends the tile into the frame in place, clipped to the frame. By the vectors of the processor,
/// bit-identical to the scalar kernel. Nothing allocates.
void blend_tile(const OverlayTileView& tile, const MutableI420View& frame);
void blend_tile(const OverlayTileView& tile, const MutableNv12View& frame);

}  // namespace sightline
