// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/tile/occlusion_tile.hpp"

#include <algorithm>

namespace sightline {

TileRect rect_around(const OcclusionDepth& hidden, int beyond_px, int width, int height) {
  constexpr int kStep = OcclusionDepth::kStep;
  const int beyond = beyond_px & ~1;
  const int left = std::clamp(kStep * hidden.x - beyond, 0, width);
  const int top = std::clamp(kStep * hidden.y - beyond, 0, height);
  const int right = std::clamp(kStep * (hidden.x + hidden.width) + beyond, left, width);
  const int bottom = std::clamp(kStep * (hidden.y + hidden.height) + beyond, top, height);
  return {left, top, right - left, bottom - top};
}

void add_occlusion_depth(const OcclusionDepth& hidden, RasterTile& tile) {
  const TileRect& rect = tile.rect();
  const TileRect covered = rect_around(hidden, 0, rect.x + rect.width, rect.y + rect.height);
  const int left = std::max(rect.x, covered.x);
  const int right = covered.x + covered.width;
  for (int y = std::max(rect.y, covered.y); y < covered.y + covered.height; ++y) {
    float* const row = tile.inverse_depth(y - rect.y);
    for (int x = left; x < right; ++x) {
      float& nearest = row[x - rect.x];
      nearest = std::max(nearest, hidden.at(x, y));
    }
  }
}

}  // namespace sightline
