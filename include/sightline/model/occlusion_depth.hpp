// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "sightline/base/time.hpp"

namespace sightline {

/// Seam from observe to render: what one camera has learned hides objects, in the part of its
/// image where they are now. Cells of kStep x kStep pixels; each says from which inverse depth
/// 1/z [1/m] on things that lie farther are hidden; 0: nothing is known to hide. Immutable once
/// handed over; any thread.
struct OcclusionDepth {
  static constexpr int kStep = 2;    ///< [px] side of a cell
  Time time{};                       ///< capture time of the frame it was learned from last
  int x = 0, y = 0;                  ///< first cell, in cells from the image's corner
  int width = 0, height = 0;         ///< [cells]
  std::vector<float> inverse_depth;  ///< row-major

  /// Of the cell at a pixel of the image; 0 outside.
  float at(int px, int py) const {
    const int cx = (px >> 1) - x, cy = (py >> 1) - y;
    if (px < 0 || py < 0 || cx < 0 || cy < 0 || cx >= width || cy >= height) return 0;
    return inverse_depth[static_cast<size_t>(cy) * static_cast<size_t>(width) +
                         static_cast<size_t>(cx)];
  }
};
using OcclusionDepthPtr = std::shared_ptr<const OcclusionDepth>;

}  // namespace sightline
