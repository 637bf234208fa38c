// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "fuse/bank/measurement_set.hpp"
#include "fuse/bank/outcome.hpp"
#include "fuse/bank/symmetric_hypotheses.hpp"
#include "fuse/update/gating.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// Updates a hypothesis with a set: prediction, gating, adaptation of the motion noise.
class HypothesisUpdate {
 public:
  /// Both have to outlive it.
  HypothesisUpdate(const EstimatorOptions& options, const SymmetricHypotheses& symmetric);

  /// Appends one outcome; of a hypothesis whose prediction is too loose one for each minimum found.
  void run(const Hypothesis& hypothesis, const MeasurementSet& set, std::vector<Outcome>& outcomes);

 private:
  Hypothesis with_symmetry_evidence(const Hypothesis& hypothesis, const MeasurementSet& set) const;
  void reacquire(const Hypothesis& predicted, const MeasurementSet& set,
                 std::vector<Outcome>& outcomes);
  bool follow_maneuver(const Hypothesis& known, const MeasurementSet& set, Hypothesis& moved);
  void forget_velocity(const Vector6& before, PoseEstimate& estimate) const;
  MotionScale needed_motion(const GatedUpdate& update, const MotionScale& motion) const;
  bool too_loose(const PoseEstimate& estimate) const;

  const EstimatorOptions& options_;
  const SymmetricHypotheses& symmetric_;
  Gating gating_;
  double nis_limit_;                  ///< squared Mahalanobis distance from the prediction
  GatedUpdate update_, calm_update_;  // scratch of one call
};

}  // namespace sightline::fuse
