// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/track/edge_lines.hpp"
#include "observe/track/line_fit.hpp"
#include "observe/track/placed_outline.hpp"
#include "observe/track/region_measurement.hpp"

namespace sightline::observe {

struct EdgeResult {
  int used = 0;         ///< lines handed out
  double noise_px = 0;  ///< of one line, the noisier of the two terms
};

/// How many lines across the outline have a step of light where a pose puts it, and how many would
/// by chance, with as many steps anywhere on them.
struct EdgeSupport {
  int lines = 0;
  int agree = 0;
  double by_chance = 0;
  Vector6 step = Vector6::Zero();  ///< from the placed pose to the one that the edges agree with

  /// 0 chance .. 1 all lines.
  double share() const { return lines > by_chance ? (agree - by_chance) / (lines - by_chance) : 0; }
};

/// Steps of light across the outline and across creases inside it, as terms of kind "edge": one for
/// limbs of smooth surfaces, one for everything else.
class EdgeMeasurement {
 public:
  EdgeMeasurement(const TrackerCamera& camera) : camera_(camera) {}

  /// Moves an outline to the nearest steps of light, whatever the colors say.
  void pull(const PlaneView& gray, const PosePrior& prior, PlacedOutline& outline);
  /// Of an outline as it was fitted and judged by colors. (A number of hits against what clutter
  /// gives: Desolneux, Moisan and Morel, IJCV 2000.)
  EdgeSupport support(const PlaneView& gray, const PosePrior& prior, const PlacedOutline& outline,
                      const OutlineAgreement& agreement);
  /// For an outline that was seen.
  EdgeResult measure(const PlaneView& gray, const PosePrior& prior, const PlacedOutline& outline,
                     const OutlineAgreement& agreement, std::vector<PoseTermPtr>& terms);

 private:
  /// Lines of one kind, [from, to) of edges_.
  struct Range {
    size_t from = 0, to = 0;
  };
  void place_edges(const PlaneView& gray, const PlacedOutline& outline);
  void keep_steps_of_outline(const PlacedOutline& outline, double noise_px);
  Vector6 fit(const PosePrior& prior, const PlacedOutline& outline,
              const OutlineAgreement& agreement);
  bool outline_steps_agree(const PlacedOutline& outline, const Vector6& step);
  double add_matches(Range range, const Vector6& step, double weight, double min_share,
                     std::vector<LineMatch>& matches);
  int add_term(std::vector<LineMatch> matches, const LineError& error, double independent_share,
               std::vector<PoseTermPtr>& terms) const;

  const TrackerCamera& camera_;
  std::vector<EdgeLine> edges_;
  Range limbs_, creases_, outer_, inner_;  ///< outer: the outline, limbs and creases
  std::vector<LineResidual> residuals_;
  std::vector<double> scratch_;
};

}  // namespace sightline::observe
