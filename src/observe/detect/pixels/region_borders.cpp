// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/region_borders.hpp"

#include <algorithm>
#include <cmath>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

constexpr int kReach = 2;  // half side of a box
constexpr int kPixels = (2 * kReach + 1) * (2 * kReach + 1);
constexpr int kAside = 4;                           // [half-size px] from the edge to a box
constexpr float kLeastVariance = 20;                // [levels^2]
constexpr std::array<int, 3> kWeights = {1, 2, 2};  // most colors are dull

}  // namespace

void RegionBorders::compute(const HalfSizeImage& image, const EdgeImage& edges) {
  width_ = image.width;
  height_ = image.height;
  bins_ = edges.bins();
  sum_up(image);
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const auto i = static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
      if (bins_[i] == 0) continue;
      const float step = kAside / edges.magnitude()[i];
      const auto dx = static_cast<int>(std::lround(step * edges.gradient_x()[i]));
      const auto dy = static_cast<int>(std::lround(step * edges.gradient_y()[i]));
      if (!differ(x + dx, y + dy, x - dx, y - dy)) bins_[i] = 0;
    }
  }
}

void RegionBorders::sum_up(const HalfSizeImage& image) {
  const auto stride = static_cast<size_t>(width_) + 1;
  for (size_t plane = 0; plane < 3; ++plane) {
    Sums& sums = sums_[plane];
    sums.values.assign(stride * (static_cast<size_t>(height_) + 1), 0);
    sums.squares.assign(sums.values.size(), 0);
    for (int y = 0; y < height_; ++y) {
      const uint8_t* row = image.row(plane, y);
      const size_t above = static_cast<size_t>(y) * stride + 1, here = above + stride;
      int32_t value = 0;
      uint32_t square = 0;
      for (size_t x = 0; x < stride - 1; ++x) {
        const int level = kWeights[plane] * (row[x] - 128);
        value += level;
        square += static_cast<uint32_t>(level * level);
        // Those of a large image may pass 2^31; differences of boxes are right all the same.
        const auto plus = [](int32_t a, uint32_t b) {
          return static_cast<int32_t>(static_cast<uint32_t>(a) + b);
        };
        sums.values[here + x] = plus(sums.values[above + x], static_cast<uint32_t>(value));
        sums.squares[here + x] = plus(sums.squares[above + x], square);
      }
    }
  }
}

RegionBorders::Normal RegionBorders::box(size_t plane, int x, int y) const {
  const auto stride = static_cast<size_t>(width_) + 1;
  const size_t top = static_cast<size_t>(y - kReach) * stride;
  const size_t bottom = static_cast<size_t>(y + kReach + 1) * stride;
  const auto left = static_cast<size_t>(x - kReach), right = static_cast<size_t>(x + kReach + 1);
  const auto difference = [&](const std::vector<int32_t>& sums) {
    const auto at = [&](size_t i) { return static_cast<uint32_t>(sums[i]); };
    return static_cast<float>(static_cast<int32_t>(at(bottom + right) - at(bottom + left) -
                                                   at(top + right) + at(top + left))) /
           kPixels;
  };
  const float mean = difference(sums_[plane].values);
  const float variance = difference(sums_[plane].squares) - mean * mean;
  return {mean, std::max(0.0f, variance) + kLeastVariance};
}

// Of normal distributions: Kailath, The divergence and Bhattacharyya distance measures in signal
// selection, 1967. What reaches over the border of the image is not known, and counts.
bool RegionBorders::differ(int x, int y, int other_x, int other_y) const {
  const auto inside = [&](int u, int v) {
    return u >= kReach && v >= kReach && u + kReach < width_ && v + kReach < height_;
  };
  if (!inside(x, y) || !inside(other_x, other_y)) return true;
  float common = 1;
  for (size_t plane = 0; plane < 3; ++plane) {
    const Normal a = box(plane, x, y), b = box(plane, other_x, other_y);
    const float sum = a.variance + b.variance, apart = a.mean - b.mean;
    common *= std::sqrt(2 * std::sqrt(a.variance * b.variance) / sum) *
              std::exp(-apart * apart / (4 * sum));
  }
  return 1 - common >= kBorderContrast;
}

}  // namespace sightline::observe
