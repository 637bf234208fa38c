// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "observe/track/colors/appearance.hpp"
#include "observe/track/contour_lines.hpp"

namespace sightline::observe {

/// Where on an object's surface a point of its outline lies, coarsely: the direction from the
/// center, on the faces of a cube, three by three each.
struct SurfaceCell {
  static constexpr size_t kCount = 54;
  static size_t of(const Eigen::Vector3d& from_center);
};

/// Levels of a pixel as bins, each channel by itself: a stretch has too few pixels for a joint
/// histogram.
struct ChannelBins {
  static constexpr size_t kLuma = 16, kChroma = 32;
  static constexpr size_t kCount = kLuma + 2 * kChroma;
  static std::array<uint8_t, 3> of(const PixelLevels& pixel) {
    return {static_cast<uint8_t>(pixel.y >> 4), static_cast<uint8_t>(kLuma + (pixel.u >> 3)),
            static_cast<uint8_t>(kLuma + kChroma + (pixel.v >> 3))};
  }
};

/// Counts of the pixels beside an outline, by cell of the surface and side.
struct LocalCounts {
  struct Side {
    std::array<uint16_t, ChannelBins::kCount> bins{};
    int pixels = 0;
  };
  struct Cell {
    Side inside, outside;
  };
  std::array<Cell, SurfaceCell::kCount> cells{};
};

/// Counts pixels as collect_colors() reads them. `center`: of the object, in its frame.
void collect_local_colors(const ColorReader& frame, std::span<const ContourLine> lines,
                          const Eigen::Vector3d& center, double gap_px, double reach_px,
                          LocalCounts& counts);

/// Colors on either side of the outline, each stretch of it by itself: what is printed on an object
/// may be the color of the background elsewhere, but seldom of the background just beside it. The
/// stretches stay with the surface, so that what is learned holds while object and camera move.
/// (Localized histograms of Hexner and Hagege, IJCV 2016, made consistent in time by Tjaden et al.,
/// PAMI 2018; channels as if independent.)
class LocalColors {
 public:
  bool known() const { return known_; }
  /// Mixes counts in with these weights for the object and for what is beside it, the first of a
  /// cell as they are. Cells that the counts say too little of stay as they are.
  void learn(const LocalCounts& counts, float inside_rate, float outside_rate);
  void forget();

  /// P(object) - P(background) with equal priors of the pixels next to a cell.
  class Cell {
   public:
    bool learned() const { return learned_; }
    float evidence(const PixelLevels& pixel) const;

   private:
    friend class LocalColors;
    using Shares = std::array<float, ChannelBins::kCount>;
    static void mix(const LocalCounts::Side& counts, float rate, Shares& shares);
    Shares inside_{}, outside_{}, evidence_{};
    bool learned_ = false;
  };
  const Cell& cell(size_t index) const { return cells_[index]; }

 private:
  std::array<Cell, SurfaceCell::kCount> cells_;
  bool known_ = false;
};

/// measure_lines() by local colors. Lines next to cells that were not learned are not measured.
void measure_lines(const ColorReader& frame, const LocalColors& colors,
                   const Eigen::Vector3d& center, int scale, std::span<ContourLine> lines);

}  // namespace sightline::observe
