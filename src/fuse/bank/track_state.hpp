// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "fuse/bank/symmetric_hypotheses.hpp"
#include "fuse/bank_state.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// What is against `tracking` that a state does not hold.
struct Objections {
  bool contradicted = false;    ///< by the newest measurements
  DegradedReasons outside = 0;  ///< by others, who look at the pose
};

/// Fills state.published from the hypotheses. While several remain, the covariance holds their
/// spread; symmetric poses are in its `alternatives`.
void publish(Time time, const Objections& objections, const EstimatorOptions& options,
             const SymmetricHypotheses& symmetric, BankState& state);

/// What becomes of a state by the time `now` if no set comes in: coasting, lost, searching.
TrackState state_in_silence(const BankState& state, Time now, const EstimatorOptions& options);

/// Appends the entries by which a track tells of that silence, each at the time its state began.
void append_silence(const BankState& state, Time now, const EstimatorOptions& options,
                    std::vector<PoseEstimate>& track);

}  // namespace sightline::fuse
