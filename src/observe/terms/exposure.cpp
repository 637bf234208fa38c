// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/exposure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace sightline::observe {
namespace {

constexpr int kBlack = 16, kNoColor = 128;      // ITU-R BT.601
constexpr int kDark = 180, kWellExposed = 205;  // luma of one pixel in
constexpr size_t kOneIn = 20;
constexpr int kSamples = 100;  // of each row and column, about
constexpr double kMostGain = 4;

void amplify(int zero, double gain, const PlaneView& from, const MutablePlaneView& to) {
  std::array<uint8_t, 256> levels{};
  for (int i = 0; i < 256; ++i) {
    const long level = std::lround(zero + gain * (i - zero));
    levels[static_cast<size_t>(i)] = static_cast<uint8_t>(std::clamp(level, 0L, 255L));
  }
  for (int y = 0; y < to.height; ++y) {
    const uint8_t* source = from.row(y);
    uint8_t* target = to.row(y);
    for (int x = 0; x < to.width; ++x) target[x] = levels[source[x]];
  }
}

}  // namespace

double exposure_gain(const PlaneView& luma) {
  const int step_x = std::max(1, luma.width / kSamples);
  const int step_y = std::max(1, luma.height / kSamples);
  std::array<size_t, 256> counts{};
  size_t total = 0;
  for (int y = step_y / 2; y < luma.height; y += step_y) {
    const uint8_t* row = luma.row(y);
    for (int x = step_x / 2; x < luma.width; x += step_x, ++total) ++counts[row[x]];
  }
  size_t brighter = 0;
  int level = 255;
  while (level > 0 && (brighter += counts[static_cast<size_t>(level)]) * kOneIn <= total) --level;
  if (level >= kDark) return 1;
  return std::min(kMostGain, double{kWellExposed - kBlack} / std::max(1, level - kBlack));
}

void expose_luma(double gain, const PlaneView& from, const MutablePlaneView& to) {
  amplify(kBlack, gain, from, to);
}

void expose_color(double gain, const PlaneView& from, const MutablePlaneView& to) {
  amplify(kNoColor, gain, from, to);
}

}  // namespace sightline::observe
