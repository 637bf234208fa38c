// SPDX-License-Identifier: Apache-2.0
#include "still_colors.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr int kEager = 32;                                // frames of which every row is taken
constexpr int kRowsApart = 8;                             // later
constexpr uint8_t kMemory = 32;                           // looks that the mean goes back
constexpr float kLeastNoise = 1.5f, kChromaNoise = 2.0f;  // [levels]
constexpr float kShadow = 0.04f;                          // share of the luma
constexpr float kBlack = 16;
constexpr float kChanged = 25;  // squared sigmas

float square(float x) { return x * x; }

}  // namespace

StillColors::StillColors(int width, int height)
    : width_(width),
      height_(height),
      cells_(static_cast<size_t>(width) * static_cast<size_t>(height)) {}

void StillColors::mix(Cell& cell, const CellColor& color) {
  const float share = 1.0f / static_cast<float>(cell.seen + 1);
  cell.noise += share * (std::abs(color.y - cell.y) * (cell.seen == 0 ? 0.0f : 1.0f) - cell.noise);
  cell.y += share * (color.y - cell.y);
  cell.u += share * (color.u - cell.u);
  cell.v += share * (color.v - cell.v);
  cell.seen = static_cast<uint8_t>(std::min<int>(cell.seen + 1, kMemory - 1));
}

void StillColors::learn(const CellReader& frame, std::span<const CellRect> objects) {
  const int apart = frames_ < kEager ? 1 : kRowsApart;
  int looked = 0, changed = 0;
  for (int y = frames_ % apart; y < height_; y += apart) {
    int x = 0;
    while (x < width_) {
      // Up to the next object in this row.
      int end = width_, next = width_;
      for (const CellRect& object : objects) {
        if (y < object.top || y >= object.bottom || x >= object.right) continue;
        if (std::max(object.left, x) < end) {
          end = std::max(object.left, x);
          next = object.right;
        }
      }
      for (; x < end; ++x) take(x, y, frame.at(x, y), looked, changed);
      x = std::max(x, next);
    }
  }
  ++frames_;
  changed_ = looked > 0 ? static_cast<float>(changed) / static_cast<float>(looked) : 0;
}

void StillColors::take(int x, int y, const CellColor& color, int& looked, int& changed) {
  if (known(x, y)) {
    ++looked;
    changed += distance(x, y, color) > kChanged ? 1 : 0;
  }
  mix(cells_[at(x, y)], color);
}

bool StillColors::alike(int x0, int y0, int x1, int y1) const {
  constexpr float kLuma = 15, kChroma = 10;  // [levels]
  const Cell &a = cells_[at(x0, y0)], &b = cells_[at(x1, y1)];
  return std::abs(a.y - b.y) <= kLuma && std::abs(a.u - b.u) + std::abs(a.v - b.v) <= kChroma;
}

bool StillColors::varied(int x, int y) const {
  constexpr int kApart = 2;
  const auto differ = [&](int x0, int y0, int x1, int y1) {
    if (x0 < 0 || y0 < 0 || x1 >= width_ || y1 >= height_) return false;
    return known(x0, y0) && known(x1, y1) && !alike(x0, y0, x1, y1);
  };
  return differ(x - kApart, y, x + kApart, y) || differ(x, y - kApart, x, y + kApart);
}

float StillColors::distance(int x, int y, const CellColor& color) const {
  const Cell& cell = cells_[at(x, y)];
  const float sigma = 1.25f * std::max(cell.noise, kLeastNoise);
  const float luma = square(sigma) + square(kShadow * std::max(cell.y - kBlack, 0.0f));
  return square(color.y - cell.y) / luma +
         (square(color.u - cell.u) + square(color.v - cell.v)) / square(kChromaNoise);
}

}  // namespace sightline::observe
