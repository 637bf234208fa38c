// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/image/planes.hpp"
#include "sightline/model/occlusion_depth.hpp"

namespace sightline::observe {

/// Color of a cell of 2x2 pixels: mean luma and the chroma sample that belongs to them.
struct CellColor {
  float y = 0, u = 0, v = 0;
};

/// Reads the cells of a frame. The caller keeps inside width() and height().
class CellReader {
 public:
  static_assert(OcclusionDepth::kStep == 2, "a cell is one chroma sample");
  explicit CellReader(const I420View& frame) : frame_(frame) {}
  int width() const { return frame_.width() / 2; }
  int height() const { return frame_.height() / 2; }
  CellColor at(int cx, int cy) const {
    const uint8_t* top = frame_.y.row(2 * cy) + 2 * cx;
    const uint8_t* bottom = top + frame_.y.stride;
    return {0.25f * static_cast<float>(top[0] + top[1] + bottom[0] + bottom[1]),
            static_cast<float>(frame_.u.row(cy)[cx]), static_cast<float>(frame_.v.row(cy)[cx])};
  }

 private:
  I420View frame_;
};

}  // namespace sightline::observe
