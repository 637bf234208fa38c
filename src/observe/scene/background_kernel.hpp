// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace sightline::observe {

/// Levels of black luma and of neutral chroma.
constexpr int kBlack = 16, kNeutral = 128;

/// A row of a camera's background (BackgroundCells) and of the image that it learns from.
struct BackgroundRow {
  std::array<const uint8_t*, 3> levels;  ///< of the image: luma and both chromas
  const uint8_t* occupied;               ///< not 0: something is in front
  std::array<int16_t*, 3> mean;          ///< 1/64 levels
  std::array<int16_t*, 2> spread;        ///< one sigma of luma and of chroma, 1/64 levels
  std::array<int, 2> min_spread;         ///< none counts as less
  uint8_t *age, *rival_age;              ///< observations
  int max_age;
  int light_part;  ///< see light_free()
  int width;
};

/// What a level would be in the light of the first frame [1/64 levels]: `part` / 2^14 of what it is
/// above `zero`.
constexpr int light_free(int level, int zero, int part) {
  const int out = zero * 64 + (((level - zero) * part) >> 8);
  return out < 32000 ? out : 32000;
}

/// Memory of the mean [observations].
constexpr int kBackgroundMemory = 32;

/// Share of the newest of n observations in their mean, 1/2^15: the n-th entry.
constexpr std::array<int, kBackgroundMemory + 1> kObservationShares = [] {
  std::array<int, kBackgroundMemory + 1> out{};
  for (int n = 1; n <= kBackgroundMemory; ++n) out[static_cast<size_t>(n)] = (1 << 15) / n;
  return out;
}();
constexpr int share_of_observation(int n) {
  return kObservationShares[static_cast<size_t>(n < kBackgroundMemory ? n : kBackgroundMemory)];
}

/// A mean after a value of that share.
constexpr int16_t moved(int16_t from, int to, int share) {
  return static_cast<int16_t>(from + (((to - from) * share) >> 15));
}

/// Takes one observation of every cell of the row that nothing occupies, that is known and that
/// shows what it usually does, as BackgroundCells::learn() does it, and sets `usual` there to 1;
/// elsewhere to 0, and nothing is changed: those are rare, and the caller's.
void learn_usual(const BackgroundRow& row, uint8_t* usual);

void learn_usual_scalar(const BackgroundRow& row, uint8_t* usual);
void learn_usual_avx2(const BackgroundRow& row, uint8_t* usual);

}  // namespace sightline::observe
