// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/foreground_masks.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

void dilate_foreground(const ForegroundMap& map, std::vector<uint8_t>& mask) {
  const auto width = static_cast<size_t>(map.width);
  mask.assign(map.classes.size(), 0);
  for (int y = 0; y < map.height; ++y) {
    const uint8_t* row = map.row(y);
    for (int x = 0; x < map.width; ++x) {
      if (row[x] == ForegroundMap::kBackground) continue;
      const int top = std::max(0, y - kForegroundMargin);
      const int bottom = std::min(map.height - 1, y + kForegroundMargin);
      const int left = std::max(0, x - kForegroundMargin);
      const int right = std::min(map.width - 1, x + kForegroundMargin);
      for (int v = top; v <= bottom; ++v) {
        uint8_t* to = mask.data() + static_cast<size_t>(v) * width;
        std::fill(to + left, to + right + 1, uint8_t{1});
      }
    }
  }
}

void magnify(const std::vector<uint8_t>& from, int from_width, int from_height, int width,
             int height, std::vector<uint8_t>& to) {
  to.resize(static_cast<size_t>(width) * static_cast<size_t>(height));
  for (int y = 0; y < height; ++y) {
    const uint8_t* row = from.data() + static_cast<size_t>(std::min(y / 2, from_height - 1)) *
                                           static_cast<size_t>(from_width);
    uint8_t* out = to.data() + static_cast<size_t>(y) * static_cast<size_t>(width);
    for (int x = 0; x < width; ++x) out[x] = row[std::min(x / 2, from_width - 1)];
  }
}

void magnify(const ForegroundMap& from, int width, int height, ForegroundMap& to) {
  to.width = width;
  to.height = height;
  to.share = from.share;
  magnify(from.classes, from.width, from.height, width, height, to.classes);
}

void reduce(const std::vector<uint8_t>& from, int from_width, int from_height,
            std::vector<uint8_t>& to) {
  const int width = from_width / 2, height = from_height / 2;
  to.resize(static_cast<size_t>(width) * static_cast<size_t>(height));
  for (int y = 0; y < height; ++y) {
    const uint8_t* above = from.data() + static_cast<ptrdiff_t>(2 * y) * from_width;
    const uint8_t* below = above + from_width;
    uint8_t* out = to.data() + static_cast<ptrdiff_t>(y) * width;
    for (int x = 0; x < width; ++x) {
      out[x] = above[2 * x] | above[2 * x + 1] | below[2 * x] | below[2 * x + 1];
    }
  }
}

void shrink(const ForegroundMap& from, int shrink, int width, int height, ForegroundMap& to) {
  to.width = width;
  to.height = height;
  to.share = from.share;
  to.classes.resize(static_cast<size_t>(width) * static_cast<size_t>(height));
  for (int y = 0; y < height; ++y) {
    const uint8_t* row = from.row(y * shrink + (shrink - 1) / 2);
    uint8_t* out = to.classes.data() + static_cast<ptrdiff_t>(y) * width;
    for (int x = 0; x < width; ++x) out[x] = row[x * shrink + (shrink - 1) / 2];
  }
}

void reduce(const ForegroundMap& from, ForegroundMap& to) {
  shrink(from, 2, from.width / 2, from.height / 2, to);
}

}  // namespace sightline::observe
