// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "sightline/observe/fiducial/target_detector.hpp"

namespace sightline {
namespace {

constexpr int kReach = 7;  // [px]: edges that are wider are too wide for any use
constexpr int kSide = 2 * kReach + 1;
constexpr int kLeastContrast = 16;  // levels of 255

/// Contrast over steepest slope around a pixel that lies far enough inside.
double width_at(const PlaneView& gray, int x, int y, std::array<uint8_t, kSide * kSide>& levels) {
  double steepest = 0;
  size_t n = 0;
  for (int row = y - kReach; row <= y + kReach; ++row) {
    const uint8_t* line = gray.row(row);
    for (int column = x - kReach; column <= x + kReach; ++column) {
      levels[n++] = line[column];
      const double dx = (line[column + 1] - line[column - 1]) / 2.0;
      const double dy = (gray.row(row + 1)[column] - gray.row(row - 1)[column]) / 2.0;
      steepest = std::max(steepest, dx * dx + dy * dy);
    }
  }
  std::sort(levels.begin(), levels.end());
  const int contrast = levels[levels.size() * 95 / 100] - levels[levels.size() * 5 / 100];
  return contrast < kLeastContrast || steepest <= 0 ? 0 : contrast / std::sqrt(steepest);
}

}  // namespace

double target_edge_width(const PlaneView& gray, const std::vector<DetectedCorner>& corners) {
  std::vector<double> widths;
  std::array<uint8_t, kSide * kSide> levels{};
  for (const DetectedCorner& corner : corners) {
    const int x = static_cast<int>(std::lround(corner.pixel.x()));
    const int y = static_cast<int>(std::lround(corner.pixel.y()));
    const int rim = kReach + 1;
    if (x < rim || y < rim || x >= gray.width - rim || y >= gray.height - rim) continue;
    const double width = width_at(gray, x, y, levels);
    if (width > 0) widths.push_back(width);
  }
  if (widths.empty()) return 0;
  const auto middle = widths.begin() + static_cast<ptrdiff_t>(widths.size() / 2);
  std::nth_element(widths.begin(), middle, widths.end());
  return *middle;
}

}  // namespace sightline
