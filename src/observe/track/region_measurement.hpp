// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/track/colors/appearance.hpp"
#include "observe/track/line_fit.hpp"
#include "observe/track/placed_outline.hpp"

namespace sightline::observe {

/// Whether the image looks like the object at a fitted outline.
struct OutlineAgreement {
  bool seen = false;
  int lines_used = 0;              ///< that agree with a visible object
  double evidence = 0;             ///< mean of (inside - outside) / 2
  double separation = 0;           ///< of the colors inside and outside
  double noise_px = 0;             ///< of one line, from the residuals
  bool local = false;              ///< by the colors of each stretch
  double edge_support = 0;         ///< EdgeSupport::share(), where it was asked for
  double scale = 1;                ///< of the residuals: 1 as large as the lines claim
  Vector6 step = Vector6::Zero();  ///< from the placed pose to the fitted one

  /// One sigma of a line that is handed out [px].
  double sigma_px(const ContourLine& line, double floor_px) const;
};

/// Judges the outline as it was measured and makes the term of kind "region" of it.
class RegionMeasurement {
 public:
  explicit RegionMeasurement(const TrackerCamera& camera) : camera_(camera) {}

  /// `separation`: of the colors by which it was measured. Lines that do not agree count as not
  /// measured from here on.
  OutlineAgreement judge(const PosePrior& prior, double separation, PlacedOutline& outline);
  /// Of an outline that was seen.
  PoseTermPtr term(const PlacedOutline& outline, const OutlineAgreement& agreement) const;

 private:
  const TrackerCamera& camera_;
  std::vector<LineResidual> residuals_;
  std::vector<double> scratch_;
};

}  // namespace sightline::observe
