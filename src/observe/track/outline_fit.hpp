// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "observe/track/colors/appearance.hpp"
#include "observe/track/colors/local_colors.hpp"
#include "observe/track/line_fit.hpp"
#include "observe/track/placed_outline.hpp"

namespace sightline::observe {

/// Moves an outline to where the image's colors put it, coarse to fine.
class OutlineFit {
 public:
  explicit OutlineFit(const TrackerCamera& camera) : camera_(camera) {}

  /// From where `outline` was placed, off by about `spread_px`; it ends placed at the fitted pose
  /// and measured. `learned`: the colors to use; null: those that this frame shows on either side.
  /// Returns the colors used, valid until the next fit; null if nothing could be measured.
  const ColorHistograms* fit(const ColorReader& frame, const PosePrior& prior, double spread_px,
                             const ColorHistograms* learned, PlacedOutline& outline);

  /// The same by the colors of each stretch of the outline: what was learned of it, mixed with what
  /// this frame shows there. False if nothing could be measured.
  bool fit_locally(const ColorReader& frame, const PosePrior& prior, double spread_px,
                   const LocalColors& learned, PlacedOutline& outline);

 private:
  const ColorHistograms* colors_beside(const ColorReader& frame, const PlacedOutline& outline,
                                       double gap_px);
  template <class Measure>
  bool settle(const Measure& measure, int scale, const PosePrior& prior, PlacedOutline& outline);
  void refine(const PosePrior& prior, int scale, PlacedOutline& outline);

  const TrackerCamera& camera_;
  ColorHistograms fresh_;  // of this very frame
  LocalColors local_;
  LocalCounts counts_;
  std::vector<LineResidual> residuals_;
  std::vector<uint16_t> foreground_, background_;
};

}  // namespace sightline::observe
