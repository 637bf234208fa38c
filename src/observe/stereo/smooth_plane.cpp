// SPDX-License-Identifier: Apache-2.0
#include "observe/stereo/smooth_plane.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

std::vector<float> gaussian(double sigma) {
  const int reach = sigma > 0 ? std::max(1, static_cast<int>(std::ceil(3 * sigma))) : 0;
  std::vector<float> kernel;
  float total = 0;
  for (int k = -reach; k <= reach; ++k) {
    kernel.push_back(sigma > 0 ? static_cast<float>(std::exp(-k * k / (2 * sigma * sigma))) : 1.0f);
    total += kernel.back();
  }
  for (float& k : kernel) k /= total;
  return kernel;
}

}  // namespace

SmoothPlane::SmoothPlane(const PlaneView& from, int x0, int y0, int x1, int y1, double sigma)
    : x0_(std::clamp(x0, 0, from.width)),
      y0_(std::clamp(y0, 0, from.height)),
      width_(std::clamp(x1, x0_, from.width) - x0_),
      height_(std::clamp(y1, y0_, from.height) - y0_),
      data_(static_cast<size_t>(width_) * static_cast<size_t>(height_)) {
  const std::vector<float> kernel = gaussian(sigma);
  const int reach = static_cast<int>(kernel.size() / 2);
  const int top = std::max(0, y0_ - reach);
  const int bottom = std::min(from.height, y0_ + height_ + reach);
  const auto columns = static_cast<size_t>(width_);
  std::vector<float> across(columns * static_cast<size_t>(std::max(0, bottom - top)));
  for (int y = top; y < bottom; ++y) {
    const uint8_t* row = from.row(y);
    float* to = &across[static_cast<size_t>(y - top) * columns];
    for (int x = 0; x < width_; ++x) {
      float sum = 0;
      for (int k = -reach; k <= reach; ++k) {
        const int at = std::clamp(x0_ + x + k, 0, from.width - 1);
        sum += kernel[static_cast<size_t>(k + reach)] * static_cast<float>(row[at]);
      }
      to[x] = sum;
    }
  }
  for (int y = 0; y < height_; ++y) {
    float* to = &data_[static_cast<size_t>(y) * columns];
    for (int k = -reach; k <= reach; ++k) {
      const int at = std::clamp(y0_ + y + k, top, bottom - 1) - top;
      const float* row = &across[static_cast<size_t>(at) * columns];
      const float weight = kernel[static_cast<size_t>(k + reach)];
      for (int x = 0; x < width_; ++x) to[x] += weight * row[x];
    }
  }
}

}  // namespace sightline::observe
