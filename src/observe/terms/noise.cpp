// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>

namespace sightline::observe {
namespace {

constexpr int kSamples = 100;        // of each row and column, about
constexpr double kGain = 6;          // of Immerkaer's mask for white noise
constexpr double kQuarter = 0.3186;  // of a normal distribution lies within so many deviations
constexpr double kClean = 2.5;       // [levels] that need no smoothing
constexpr double kLess = 0.8;        // of the noise before it is smoothed less than it was
// What so many passes leave of white noise.
constexpr std::array<double, Smoothing::kMost + 1> kLeft = {1,     0.375, 0.273, 0.226,
                                                            0.196, 0.176, 0.161};

// Central differences at a step of one, times two, after so many.
constexpr std::array<float, Smoothing::kMost + 1> kSharpness = {1,      0.75f,  0.625f, 0.547f,
                                                                0.492f, 0.451f, 0.419f};

int passes_for(double noise) {
  int passes = 0;
  while (passes < Smoothing::kMost && noise * kLeft[static_cast<size_t>(passes)] > kClean) ++passes;
  return passes;
}

/// By how much a pixel differs from its neighbors' second differences, times kGain.
int difference(const PlaneView& plane, int x, int y) {
  const uint8_t *a = plane.row(y - 1) + x, *b = plane.row(y) + x, *c = plane.row(y + 1) + x;
  return a[-1] + a[1] + c[-1] + c[1] - 2 * (a[0] + b[-1] + b[1] + c[0]) + 4 * b[0];
}

}  // namespace

double noise_level(const PlaneView& plane) {
  const int step_x = std::max(1, plane.width / kSamples);
  const int step_y = std::max(1, plane.height / kSamples);
  std::array<size_t, 8 * 255 + 1> counts{};
  size_t total = 0;
  for (int y = 1; y < plane.height - 1; y += step_y) {
    for (int x = 1; x < plane.width - 1; x += step_x, ++total)
      ++counts[static_cast<size_t>(std::abs(difference(plane, x, y)))];
  }
  if (total == 0) return 0;
  size_t below = 0, level = 0;
  while (4 * (below + counts[level]) < total) below += counts[level++];
  // Levels are whole: as if they were spread evenly.
  const double part = (static_cast<double>(total) / 4 - static_cast<double>(below)) /
                      static_cast<double>(counts[level]);
  return std::max(0.0, static_cast<double>(level) + part - 0.5) / (kGain * kQuarter);
}

int Smoothing::update(const PlaneView& plane) {
  const double noise = noise_level(plane);
  const int wanted = passes_for(noise);
  if (wanted > passes_ || passes_for(noise / kLess) < passes_) passes_ = wanted;
  return passes_;
}

float BinomialFilter::sharpness(int passes) { return kSharpness.at(static_cast<size_t>(passes)); }

void BinomialFilter::smooth(const MutablePlaneView& plane, int passes) {
  for (int i = 0; i < passes; ++i) pass(plane);
}

void BinomialFilter::pass(const MutablePlaneView& plane) {
  const auto width = static_cast<size_t>(plane.width);
  if (width == 0 || plane.height == 0) return;
  above_.assign(plane.row(0), plane.row(0) + width);
  here_.resize(width);
  sums_.resize(width + 2);
  for (int y = 0; y < plane.height; ++y) {
    uint8_t* row = plane.row(y);
    const uint8_t* below = plane.row(std::min(y + 1, plane.height - 1));
    std::copy_n(row, width, here_.begin());
    uint16_t* sums = sums_.data() + 1;
    for (size_t x = 0; x < width; ++x)
      sums[x] = static_cast<uint16_t>(above_[x] + 2 * here_[x] + below[x]);
    sums[-1] = sums[0];
    sums[width] = sums[width - 1];
    for (size_t x = 0; x < width; ++x)
      row[x] = static_cast<uint8_t>((sums[x - 1] + 2 * sums[x] + sums[x + 1] + 8) >> 4);
    above_.swap(here_);
  }
}

}  // namespace sightline::observe
