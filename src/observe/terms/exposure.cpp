// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/exposure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "sightline/base/vectors.hpp"

namespace sightline::observe {
namespace {

constexpr int kBlack = 16, kNoColor = 128;                        // ITU-R BT.601
constexpr int kDark = 130, kStillDark = 160, kWellExposed = 205;  // luma of one pixel in
constexpr size_t kOneIn = 20;
constexpr int kSamples = 50;  // of each row and column, about
constexpr double kMostGain = 4;
constexpr double kAnotherLight = 1.25;                // gain or its inverse, from which it changes
constexpr int kUnitBits = 5, kUnit = 1 << kUnitBits;  // of a gain

/// A level less `zero` times a gain, and `zero` again; 16 bits hold all of it.
struct Amplifier {
  Amplifier(int zero, double gain)
      : factor(static_cast<int16_t>(std::lround(kUnit * gain))),
        below(static_cast<int16_t>((zero * factor + kUnit / 2) / kUnit - zero)) {}

  template <typename Levels>
  Levels operator()(Levels level) const {
    Levels out = (level * factor + kUnit / 2) >> kUnitBits;
    out = (out > below ? out : below + Levels{}) - below;
    return out < 255 ? out : 255 + Levels{};
  }

  int16_t factor, below;
};

void amplify(const Amplifier& amplified, const PlaneView& from, const MutablePlaneView& to) {
  using Words [[gnu::vector_size(vectors::kBytes)]] = int16_t;
  using vectors::HalfBytes;
  constexpr int kLanes = vectors::kBytes / 2;
  for (int y = 0; y < to.height; ++y) {
    const uint8_t* source = from.row(y);
    uint8_t* target = to.row(y);
    int x = 0;
    for (; x + kLanes <= to.width; x += kLanes) {
      const auto levels = __builtin_convertvector(vectors::load<HalfBytes>(source + x), Words);
      vectors::store(target + x, __builtin_convertvector(amplified(levels), HalfBytes));
    }
    for (; x < to.width; ++x) target[x] = static_cast<uint8_t>(amplified(int{source[x]}));
  }
}

/// That one pixel in kOneIn reaches.
int bright_level(const PlaneView& luma) {
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
  return level;
}

double gain_for(int level) {
  const double wanted = double{kWellExposed - kBlack} / std::max(1, level - kBlack);
  return std::round(kUnit * std::min(kMostGain, wanted)) / kUnit;
}

}  // namespace

double ExposureGain::update(const PlaneView& luma) {
  const int level = bright_level(luma);
  const double wanted = level < (gain_ > 1 ? kStillDark : kDark) ? gain_for(level) : 1;
  const bool other = wanted > kAnotherLight * gain_ || kAnotherLight * wanted < gain_;
  if (!known_ || other) gain_ = wanted;
  known_ = true;
  return gain_;
}

void expose_luma(double gain, const PlaneView& from, const MutablePlaneView& to) {
  amplify(Amplifier(kBlack, gain), from, to);
}

void expose_color(double gain, const PlaneView& from, const MutablePlaneView& to) {
  amplify(Amplifier(kNoColor, gain), from, to);
}

}  // namespace sightline::observe
