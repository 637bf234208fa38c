// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/surface_colors.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr uint8_t kMemory = 64;                // samples that the mean goes back
constexpr float kShading = 0.20f;              // share of the luma
constexpr float kMinLuma = 5, kMinChroma = 4;  // [levels]
constexpr float kBlack = 16;

float square(float x) { return x * x; }

}  // namespace

SurfaceColors::SurfaceColors(const Eigen::Vector3d& center, double radius)
    : low_((center.array() - radius).cast<float>().matrix()),
      per_meter_(static_cast<float>(kSide / (2 * radius))),
      cubes_(static_cast<size_t>(kSide) * kSide * kSide),
      palette_(static_cast<size_t>(kLumaBins) * kChromaBins * kChromaBins) {}

size_t SurfaceColors::at(const Eigen::Vector3f& point_in_object) const {
  size_t index = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float along = (point_in_object[axis] - low_[axis]) * per_meter_;
    index = index * kSide + static_cast<size_t>(std::clamp(along, 0.0f, kSide - 1.0f));
  }
  return index;
}

void SurfaceColors::learn(size_t place, const CellColor& color) {
  Cube& cube = cubes_[place];
  const float share = 1.0f / static_cast<float>(cube.seen + 1);
  if (cube.seen > 0) {
    const float chroma = 0.5f * (std::abs(color.u - cube.u) + std::abs(color.v - cube.v));
    cube.spread_y += share * (std::abs(color.y - cube.y) - cube.spread_y);
    cube.spread_c += share * (chroma - cube.spread_c);
  }
  cube.y += share * (color.y - cube.y);
  cube.u += share * (color.u - cube.u);
  cube.v += share * (color.v - cube.v);
  cube.seen = static_cast<uint8_t>(std::min<int>(cube.seen + 1, kMemory - 1));
  samples_ = std::min(samples_ + 1, kManySamples);
  uint8_t& count = palette_[bin(static_cast<int>(color.y) / (256 / kLumaBins),
                                static_cast<int>(color.u) / (256 / kChromaBins),
                                static_cast<int>(color.v) / (256 / kChromaBins))];
  count = static_cast<uint8_t>(std::min(count + 1, 255));
}

bool SurfaceColors::has(const CellColor& color) const {
  constexpr int kOften = 8;
  const int y = static_cast<int>(color.y) / (256 / kLumaBins);
  const int u = static_cast<int>(color.u) / (256 / kChromaBins);
  const int v = static_cast<int>(color.v) / (256 / kChromaBins);
  int count = 0;
  for (int a = std::max(0, y - 1); a <= std::min(kLumaBins - 1, y + 1); ++a) {
    for (int b = std::max(0, u - 1); b <= std::min(kChromaBins - 1, u + 1); ++b) {
      for (int c = std::max(0, v - 1); c <= std::min(kChromaBins - 1, v + 1); ++c) {
        count += palette_[bin(a, b, c)];
      }
    }
  }
  return count >= kOften;
}

float SurfaceColors::distance(size_t place, const CellColor& color) const {
  const Cube& cube = cubes_[place];
  const float luma = square(kMinLuma) + square(1.25f * cube.spread_y) +
                     square(kShading * std::max(cube.y - kBlack, 0.0f));
  const float chroma = square(kMinChroma) + square(1.25f * cube.spread_c);
  return square(color.y - cube.y) / luma +
         (square(color.u - cube.u) + square(color.v - cube.v)) / chroma;
}

}  // namespace sightline::observe
