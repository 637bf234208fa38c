// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/coarse_maps.hpp"

#include <algorithm>

#include "observe/detect/pixels/foreground_masks.hpp"

namespace sightline::observe {

void CoarseMaps::show(const HalfSizeImage& image, const std::vector<uint8_t>& mask, int margin) {
  reduce(image, image_);
  edges_.compute(image_);
  if (!mask.empty()) {
    reduce(mask, image.width, image.height, mask_);
    edges_.keep_where(mask_);
  }
  borders_.compute(image_, edges_);
  search_.respond_to(edges_, borders_.bins(), margin / kShrink + 1);
}

std::vector<std::array<int, 2>> coarse_rows(const std::vector<std::array<int, 2>>& rows,
                                            int height) {
  std::vector<std::array<int, 2>> out;
  if (rows.empty()) return out;
  const auto last = static_cast<int>(rows.size()) - 1;
  for (int y = 0; y < height; ++y) {
    const auto& above = rows[static_cast<size_t>(std::min(CoarseMaps::kShrink * y, last))];
    const auto& below = rows[static_cast<size_t>(std::min(CoarseMaps::kShrink * y + 1, last))];
    const bool upper = above[0] < above[1], lower = below[0] < below[1];
    if (!upper && !lower) {
      out.push_back({0, 0});
      continue;
    }
    const int left = upper && lower ? std::min(above[0], below[0]) : upper ? above[0] : below[0];
    const int right = upper && lower ? std::max(above[1], below[1]) : upper ? above[1] : below[1];
    out.push_back({left / CoarseMaps::kShrink, (right + 1) / CoarseMaps::kShrink});
  }
  return out;
}

}  // namespace sightline::observe
