// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/image_colors.hpp"

#include <algorithm>

namespace sightline::observe {
namespace {

bool varies(const PlaneView& plane) {
  constexpr int kStep = 8, kTint = 6;  // [pixels, levels] noise of compressed video is less
  int least = 255, most = 0;
  for (int y = 0; y < plane.height; y += kStep) {
    const uint8_t* row = plane.row(y);
    for (int x = 0; x < plane.width; x += kStep) {
      least = std::min<int>(least, row[x]);
      most = std::max<int>(most, row[x]);
    }
    if (most - least > kTint) return true;
  }
  return false;
}

}  // namespace

bool has_colors(const PlaneView& u, const PlaneView& v) { return varies(u) || varies(v); }

}  // namespace sightline::observe
