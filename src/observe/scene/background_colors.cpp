// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/background_colors.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr int kAllRowsFrames = 32;  // of which every row is learned from
constexpr int kRowStep = 8;         // later
constexpr int kSpreadPeriod = 16;   // frames between measurements of the usual spread
// A thing that is put down becomes background after so many observations of each row.
constexpr int kMaxAge = 31;
constexpr float kMinLumaSigma = 1.875f, kMinChromaSigma = 2;  // [levels]
constexpr float kShadow = 0.04f;                              // share of the luma
constexpr float kDiffers = 25;                                // squared sigmas
constexpr float kPerUnit = 1.0f / BackgroundCells::kUnit;

float square(float x) { return x * x; }

int units(float level) { return static_cast<int>(level * BackgroundCells::kUnit); }

}  // namespace

BackgroundColors::BackgroundColors(int width, int height) : cells_(kMaxAge) {
  cells_.reset(width, height);
}

void BackgroundColors::learn(const CellReader& frame, std::span<const CellRect> objects) {
  const int step = frames_ < kAllRowsFrames ? 1 : kRowStep;
  Tally tally;
  for (int y = frames_ % step; y < cells_.height(); y += step) {
    int x = 0;
    while (x < cells_.width()) {
      // Up to the next object in this row.
      int end = cells_.width(), next = cells_.width();
      for (const CellRect& object : objects) {
        if (y < object.top || y >= object.bottom || x >= object.right) continue;
        if (std::max(object.left, x) < end) {
          end = std::max(object.left, x);
          next = object.right;
        }
      }
      for (; x < end; ++x) take(x, y, frame.at(x, y), tally);
      x = std::max(x, next);
    }
  }
  ++frames_;
  if (frames_ % kSpreadPeriod == 0) cells_.measure_min_spread();
  changed_ = tally.compared > 0
                 ? static_cast<float>(tally.differing) / static_cast<float>(tally.compared)
                 : 0;
}

void BackgroundColors::take(int x, int y, const CellColor& color, Tally& tally) {
  if (known(x, y)) {
    ++tally.compared;
    tally.differing += distance(x, y, color) > kDiffers ? 1 : 0;
  }
  cells_.learn(cells_.index(x, y), {units(color.y), units(color.u), units(color.v)});
}

bool BackgroundColors::similar(int x0, int y0, int x1, int y1) const {
  constexpr int kLuma = 15 * BackgroundCells::kUnit, kChroma = 10 * BackgroundCells::kUnit;
  const auto a = cells_.mean(cells_.index(x0, y0)), b = cells_.mean(cells_.index(x1, y1));
  return std::abs(a.y - b.y) <= kLuma && std::abs(a.u - b.u) + std::abs(a.v - b.v) <= kChroma;
}

bool BackgroundColors::textured(int x, int y) const {
  constexpr int kReach = 2;
  const auto differ = [&](int x0, int y0, int x1, int y1) {
    if (x0 < 0 || y0 < 0 || x1 >= cells_.width() || y1 >= cells_.height()) return false;
    return known(x0, y0) && known(x1, y1) && !similar(x0, y0, x1, y1);
  };
  return differ(x - kReach, y, x + kReach, y) || differ(x, y - kReach, x, y + kReach);
}

float BackgroundColors::distance(int x, int y, const CellColor& color) const {
  const size_t cell = cells_.index(x, y);
  const BackgroundCells::Color mean = cells_.mean(cell);
  const float usual = kPerUnit * static_cast<float>(mean.y);
  const float sigma =
      std::max(kPerUnit * static_cast<float>(cells_.spread(0, cell)), kMinLumaSigma);
  const float chroma_sigma =
      std::max(kPerUnit * static_cast<float>(cells_.spread(1, cell)), kMinChromaSigma);
  const float luma = square(sigma) + square(kShadow * std::max(usual - kBlack, 0.0f));
  return square(color.y - usual) / luma +
         (square(color.u - kPerUnit * static_cast<float>(mean.u)) +
          square(color.v - kPerUnit * static_cast<float>(mean.v))) /
             square(chroma_sigma);
}

}  // namespace sightline::observe
