// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "fuse/bank/measurement_set.hpp"
#include "fuse/bank/outcome.hpp"
#include "fuse/bank/symmetric_hypotheses.hpp"
#include "fuse/update/gating.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// Starts hypotheses at the poses that the cameras of a set propose by themselves.
class TrackInitiation {
 public:
  /// The options and symmetries have to outlive it.
  TrackInitiation(const EstimatorOptions& options, const SymmetricHypotheses& symmetric,
                  ObjectId object);

  /// Appends an outcome for each proposed pose that its measurements confirm. `evidence` is what
  /// the new hypotheses have from before the set; `challenger`: they contradict the one in force.
  void run(const MeasurementSet& set, double evidence, bool challenger,
           std::vector<Outcome>& outcomes);

 private:
  void start(const MeasurementSet& set, const CameraMeasurement& proposer, const Rigid3& pose,
             const Hypothesis& fresh, std::vector<Outcome>& outcomes);

  const EstimatorOptions& options_;
  const SymmetricHypotheses& symmetric_;
  ObjectId object_;
  Gating gating_;
  GatedUpdate update_;                       // scratch of one call
  std::vector<CameraMeasurement> agreeing_;  // scratch of one call
};

}  // namespace sightline::fuse
