// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "observe/scene/background_kernel.hpp"

namespace sightline::observe {

/// What a fixed camera sees at every cell of 2x2 pixels (one pixel at half size) while nothing is
/// in front: running mean of luma and chroma over the last 32 observations and their spread (one
/// Gaussian a cell: Wren et al., "Pfinder", PAMI 1997), and one rival that replaces them once it
/// has been seen for longer, so that what was learned from something at rest goes away after it
/// left, and what is put down becomes background (Stauffer and Grimson, CVPR 1999, with two modes).
///
/// Which cells are learned from, how often, and in which light is the caller's. Levels are in units
/// of 1/64. Nothing is allocated after reset().
class BackgroundCells {
 public:
  static constexpr int kUnit = 64;   ///< per level
  static constexpr int kKnown = 4;   ///< observations from which a cell is known
  static constexpr int kMature = 8;  ///< ... and from which its spread is believed
  static constexpr int kMaxAge = 250;

  struct Color {
    int y = 0, u = 0, v = 0;
  };

  /// `max_age`: observations after which a cell counts as no older, so that a rival needs at most
  /// so many to replace it; kMature + 1 .. kMaxAge.
  explicit BackgroundCells(int max_age) : max_age_(max_age) {}
  void reset(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }

  /// Takes one observation of a cell. False if it differs from the background: then it counts for
  /// the rival.
  bool learn(size_t cell, const Color& color) {
    if (main_.age[cell] == 0 || within_four_sigmas(main_, cell, color)) {
      confirm(cell, color);
      return true;
    }
    contest(cell, color);
    return false;
  }
  /// Takes one observation of a row in this light, of the cells that nothing occupies; of how many
  /// of them, and how many differ from the background.
  struct Learned {
    size_t observed = 0, changed = 0;
  };
  Learned learn_row(int y, const std::array<const uint8_t*, 3>& levels, const uint8_t* occupied,
                    int light_part);
  /// The scene has changed: what is seen from now on replaces what was learned at once.
  void relearn();

  int age(size_t cell) const { return main_.age[cell]; }
  bool known(size_t cell) const { return main_.age[cell] >= kKnown; }
  Color mean(size_t cell) const {
    return {main_.mean[0][cell], main_.mean[1][cell], main_.mean[2][cell]};
  }
  /// Rows for pixel loops: luma and both chromas, and one sigma of luma and of chroma.
  const int16_t* mean_row(size_t channel, int y) const {
    return main_.mean[channel].data() + index(0, y);
  }
  const int16_t* spread_row(size_t channel, int y) const {
    return spread_[channel].data() + index(0, y);
  }
  int spread(size_t channel, size_t cell) const { return spread_[channel][cell]; }

  /// The spread of a single cell is uncertain while it is young: none counts as less than the
  /// median. Measures that again and returns the share of the cells that are mature.
  double measure_min_spread();
  int min_spread(size_t channel) const { return min_spread_[channel]; }

 private:
  static constexpr int kFirstSpread = 3 * kUnit;

  struct Mode {
    std::array<std::vector<int16_t>, 3> mean;
    std::vector<uint8_t> age;  // observations
    void resize(size_t size) {
      for (auto& plane : mean) plane.assign(size, 0);
      age.assign(size, 0);
    }
  };

  bool within_four_sigmas(const Mode& mode, size_t i, const Color& color) const {
    const int luma = 4 * std::max<int>(spread_[0][i], min_spread_[0]);
    const int chroma = 4 * std::max<int>(spread_[1][i], min_spread_[1]);
    return std::abs(color.y - mode.mean[0][i]) < luma &&
           std::abs(color.u - mode.mean[1][i]) < chroma &&
           std::abs(color.v - mode.mean[2][i]) < chroma;
  }

  static void mix(Mode& mode, size_t i, const Color& color, int max_age) {
    const int n = mode.age[i] + 1;
    const int share = share_of_observation(n);
    const std::array<int, 3> values = {color.y, color.u, color.v};
    for (size_t k = 0; k < 3; ++k) mode.mean[k][i] = moved(mode.mean[k][i], values[k], share);
    mode.age[i] = static_cast<uint8_t>(std::min(n, max_age));
  }

  void confirm(size_t i, const Color& color) {
    if (main_.age[i] > 0) {
      // Mean absolute deviation, as sigma of a normal distribution: times 1.25.
      const int luma = std::abs(color.y - main_.mean[0][i]) * 5 / 4;
      const int chroma =
          (std::abs(color.u - main_.mean[1][i]) + std::abs(color.v - main_.mean[2][i])) * 5 / 8;
      const int share = share_of_observation(main_.age[i] + 3);
      spread_[0][i] = moved(spread_[0][i], luma, share);
      spread_[1][i] = moved(spread_[1][i], chroma, share);
    }
    mix(main_, i, color, max_age_);
    if (rival_.age[i] > 0) --rival_.age[i];
  }

  void contest(size_t i, const Color& color) {
    if (rival_.age[i] > 0 && !within_four_sigmas(rival_, i, color)) {
      if (--rival_.age[i] > 0) return;
    }
    mix(rival_, i, color, kMaxAge);
    if (rival_.age[i] <= main_.age[i]) return;
    for (size_t k = 0; k < 3; ++k) main_.mean[k][i] = rival_.mean[k][i];
    main_.age[i] = static_cast<uint8_t>(std::min<int>(rival_.age[i], max_age_));
    rival_.age[i] = 0;
  }

  int max_age_;
  int width_ = 0, height_ = 0;
  Mode main_, rival_;
  std::array<std::vector<int16_t>, 2> spread_;  // one sigma of luma and of chroma
  std::array<int, 2> min_spread_{};
  std::vector<uint8_t> usual_;  // of the row that is learned
};

}  // namespace sightline::observe
