// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "fuse/bank/measurement_set.hpp"
#include "fuse/bank/symmetric_hypotheses.hpp"
#include "fuse/bank_state.hpp"
#include "fuse/update/gating.hpp"

namespace sightline::fuse {

/// One possible continuation of the bank after a set. Index of the arrays: camera bit.
struct Outcome {
  Hypothesis hypothesis;
  CameraSet accepted = 0;
  CameraSet gated = 0;
  int iterations = 0;
  std::array<double, 64> normalized_cost{};
  std::array<Agreement, 64> agreement{};
  std::array<InformationInnovation, 64> innovations{};
};

/// What a set makes of a hypothesis. `predicted`: the hypothesis at the set's time; `update`: of it
/// with the set's measurements.
Outcome outcome_of(const Hypothesis& predicted, const GatedUpdate& update,
                   const MeasurementSet& set, const SymmetricHypotheses& symmetric,
                   const EstimatorOptions& options);

}  // namespace sightline::fuse
