// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/overlay/lines/draw.hpp"
#include "sightline/image/blend.hpp"

namespace sightline::render {

/// The frame being drawn into, I420 or NV12.
struct FrameTarget {
  draw::Canvas canvas;
  const MutableI420View* i420 = nullptr;
  const MutableNv12View* nv12 = nullptr;

  int width() const { return canvas.y.width; }
  int height() const { return canvas.y.height; }
  void blend(const OverlayTileView& tile) const {
    if (i420 != nullptr) {
      blend_tile(tile, *i420);
    } else {
      blend_tile(tile, *nv12);
    }
  }
};

}  // namespace sightline::render
