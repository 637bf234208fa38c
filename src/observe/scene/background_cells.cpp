// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/background_cells.hpp"

namespace sightline::observe {

void BackgroundCells::reset(int width, int height) {
  width_ = width;
  height_ = height;
  const size_t size = static_cast<size_t>(width) * static_cast<size_t>(height);
  main_.resize(size);
  rival_.resize(size);
  for (auto& plane : spread_) plane.assign(size, kFirstSpread);
  min_spread_ = {kFirstSpread, kFirstSpread};
}

void BackgroundCells::relearn() {
  for (uint8_t& age : main_.age) age = std::min<uint8_t>(age, 2);
}

double BackgroundCells::measure_min_spread() {
  constexpr size_t kStep = 5;          // cells: a sample is enough
  constexpr int kLeastSpread = kUnit;  // one sigma of half-size pixels of a quiet camera
  std::array<int, 2048> histogram;
  size_t mature = 0, counted = 0;
  for (size_t k = 0; k < 2; ++k) {
    histogram.fill(0);
    mature = counted = 0;
    for (size_t i = 0; i < main_.age.size(); i += kStep) {
      ++counted;
      if (main_.age[i] < kMature) continue;
      ++mature;
      ++histogram[static_cast<size_t>(std::clamp<int>(spread_[k][i], 0, 2047))];
    }
    size_t below = 0;
    int median = 0;
    while (mature > 0 &&
           below + static_cast<size_t>(histogram[static_cast<size_t>(median)]) <= mature / 2) {
      below += static_cast<size_t>(histogram[static_cast<size_t>(median++)]);
    }
    if (mature > 0) min_spread_[k] = std::max(kLeastSpread, median);
  }
  return counted > 0 ? static_cast<double>(mature) / static_cast<double>(counted) : 0;
}

}  // namespace sightline::observe
