// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/search_camera.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {

void SearchCamera::respond_to(const EdgeImage& image_edges,
                              const std::vector<uint8_t>& region_borders, int map_margin) {
  edges = &image_edges;
  borders = &region_borders;
  margin = map_margin;
  for (auto& made : spreads_->made) made = false;
}

const ResponseMaps& SearchCamera::spread(int index) const {
  const auto at = static_cast<size_t>(index);
  Spreads& spreads = *spreads_;
  if (!spreads.made[at].load(std::memory_order_acquire)) {
    std::lock_guard lock(spreads.mutex);
    if (!spreads.made[at].load(std::memory_order_relaxed)) {
      spreads.maps[at].compute(*edges, *borders, index + 1, margin);
      spreads.made[at].store(true, std::memory_order_release);
    }
  }
  return spreads.maps[at];
}

int SearchCamera::motion_px(double scale) const {
  return static_cast<int>(std::lround(2 * usual_speed * std::abs(seconds) * scale));
}

const ResponseMaps& SearchCamera::far(double scale, double radius) const {
  const int steps = static_cast<int>(std::lround(kSpreadShare * scale * radius));
  return spread(std::min(std::max(2, steps) + motion_px(scale), kSpreads) - 1);
}

const ResponseMaps& SearchCamera::near(double scale) const {
  return spread(std::min(motion_px(scale), kSpreads - 1));
}

}  // namespace sightline::observe
