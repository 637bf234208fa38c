// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "fuse/bank_state.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// Proposed poses that are tried per set and hypothesis.
constexpr size_t kMaxProposals = 8;

/// The hypothesis' estimate at `time`, with the motion noise scaled by `motion`; no camera is
/// credited with it.
PoseEstimate predicted(const Hypothesis& hypothesis, Time time, const MotionScale& motion,
                       const EstimatorOptions& options);

/// Takes out hypotheses that no camera measured for `lost_after`, and what was learned of the
/// motion before a gap.
void expire(Time time, const EstimatorOptions& options, BankState& state);

}  // namespace sightline::fuse
