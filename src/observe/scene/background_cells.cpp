// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/background_cells.hpp"

#include <cstring>

namespace sightline::observe {
namespace {

constexpr size_t kAtOnce = sizeof(uint64_t);

bool all_usual(const uint8_t* usual) {
  uint64_t cells = 0;
  std::memcpy(&cells, usual, kAtOnce);
  return cells == 0x0101010101010101;
}

}  // namespace

void BackgroundCells::reset(int width, int height) {
  width_ = width;
  height_ = height;
  const size_t size = static_cast<size_t>(width) * static_cast<size_t>(height);
  main_.resize(size);
  rival_.resize(size);
  for (auto& plane : spread_) plane.assign(size, kFirstSpread);
  usual_.assign(static_cast<size_t>(width), 0);
  min_spread_ = {kFirstSpread, kFirstSpread};
}

BackgroundCells::Learned BackgroundCells::learn_row(int y,
                                                    const std::array<const uint8_t*, 3>& levels,
                                                    const uint8_t* occupied, int light_part) {
  const size_t first = index(0, y);
  BackgroundRow row{levels,
                    occupied,
                    {},
                    {},
                    min_spread_,
                    main_.age.data() + first,
                    rival_.age.data() + first,
                    max_age_,
                    light_part,
                    width_};
  for (size_t k = 0; k < 3; ++k) row.mean[k] = main_.mean[k].data() + first;
  for (size_t k = 0; k < 2; ++k) row.spread[k] = spread_[k].data() + first;
  learn_usual(row, usual_.data());
  Learned out;
  const auto width = static_cast<size_t>(width_);
  for (size_t x = 0; x < width; ++x) {
    for (; x + kAtOnce <= width && all_usual(usual_.data() + x); x += kAtOnce) {
      out.observed += kAtOnce;
    }
    if (x == width) break;
    if (occupied[x] != 0) continue;
    ++out.observed;
    if (usual_[x] != 0) continue;
    const Color color{light_free(levels[0][x], kBlack, light_part),
                      light_free(levels[1][x], kNeutral, light_part),
                      light_free(levels[2][x], kNeutral, light_part)};
    out.changed += learn(first + x, color) ? 0 : 1;
  }
  return out;
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
