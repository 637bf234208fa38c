// SPDX-License-Identifier: Apache-2.0
#include "observe/track/outline_fit.hpp"

#include <algorithm>
#include <cmath>

#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

const ColorHistograms* OutlineFit::colors_beside(const ColorReader& frame,
                                                 const PlacedOutline& outline, double gap_px) {
  collect_colors(frame, outline.lines(), gap_px, kLearnReachPx, foreground_, background_);
  fresh_.forget();
  return fresh_.learn(foreground_, background_, 1.0f) ? &fresh_ : nullptr;
}

void OutlineFit::refine(const PosePrior& prior, int scale, PlacedOutline& outline) {
  const double inflation =
      kPlacingInflation / outline.independent_share(camera_.options.region_correlation_px);
  residuals_.clear();
  for (const ContourLine& line : outline.lines()) {
    if (!line.measured) continue;
    residuals_.push_back({line.by_pose, line.mean, std::sqrt(inflation * line.variance)});
  }
  const Vector6 step = fit_lines(residuals_, prior.information, prior.offset_of(outline.pose()),
                                 scale > 1 ? kPlacingHuber : camera_.options.huber);
  outline.place(outline.pose() * Rigid3::exp(step));
}

// Measures with segments of `scale` pixels and moves the outline, until it stays where it is.
template <class Measure>
bool OutlineFit::settle(const Measure& measure, int scale, const PosePrior& prior,
                        PlacedOutline& outline) {
  const int passes = scale > 1 ? kPlacingPasses : 1;
  for (int pass = 0; pass < passes; ++pass) {
    if (!measure(scale)) return false;
    const Rigid3 before = outline.pose();
    refine(prior, scale, outline);
    if (outline.distance_to(before) < scale) break;
  }
  return true;
}

namespace {

int coarsest_scale(double spread_px) {
  const double needed = kSpreadSigmas * spread_px / kOffsetsSpan;
  return std::clamp(static_cast<int>(std::ceil(needed)), 1, kMaxScale);
}

int finer(int scale) { return scale > 3 ? scale / 2 : scale - 1; }

double first_gap(double spread_px) {
  return std::min(std::max(kLearnGapPx, spread_px), kMaxLearnGapPx);
}

}  // namespace

const ColorHistograms* OutlineFit::fit(const ColorReader& frame, const PosePrior& prior,
                                       double spread_px, const ColorHistograms* learned,
                                       PlacedOutline& outline) {
  const ColorHistograms* colors = learned;
  double gap = first_gap(spread_px);
  const auto measure = [&](int scale) {
    if (learned == nullptr) colors = colors_beside(frame, outline, gap);
    gap = kLearnGapPx;
    if (colors == nullptr) return false;
    measure_lines(frame, *colors, scale, outline.lines());
    outline.correct_for_rolling();
    return true;
  };
  for (int scale = coarsest_scale(spread_px); scale > 0; scale = finer(scale)) {
    if (!settle(measure, scale, prior, outline)) return nullptr;
  }
  if (!measure(1)) return nullptr;
  correct_for_gamma(camera_.options.gamma, camera_.options.blur_px, outline.lines());
  return colors;
}

bool OutlineFit::fit_locally(const ColorReader& frame, const PosePrior& prior, double spread_px,
                             const LocalColors& learned, PlacedOutline& outline) {
  const Eigen::Vector3d& center = outline.center();
  double gap = first_gap(spread_px);
  const auto measure = [&](int scale) {
    collect_local_colors(frame, outline.lines(), center, gap, kLearnReachPx, counts_);
    local_ = learned;
    // The object keeps its colors; what is beside it changes as it moves.
    local_.learn(counts_, 0.0f, kFreshLocalShare);
    gap = kLearnGapPx;
    measure_lines(frame, local_, center, scale, outline.lines());
    outline.correct_for_rolling();
    return local_.known();
  };
  for (int scale = coarsest_scale(spread_px); scale > 0; scale = finer(scale)) {
    if (!settle(measure, scale, prior, outline)) return false;
  }
  if (!measure(1)) return false;
  correct_for_gamma(camera_.options.gamma, camera_.options.blur_px, outline.lines());
  return true;
}

}  // namespace sightline::observe
