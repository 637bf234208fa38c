// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "fuse/bank/outcome.hpp"
#include "fuse/bank_state.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// How long a camera's last frame counts: some of its frame periods, bounded.
Duration hold(const CameraRecord& record, const EstimatorOptions& options);

/// Until when the last camera holds the object; Time::min() if none does.
Time held_until(const BankState& state, const EstimatorOptions& options);

/// Cameras that hold the object at `time`: they saw it in their newest frame, not too long ago.
CameraSet holding_cameras(Time time, const EstimatorOptions& options, const BankState& state);
/// How many see the object elsewhere: refused in their newest frame, as recent as those that hold
/// it.
int refused_cameras(Time time, const EstimatorOptions& options, const BankState& state);

/// Notes for every camera of the set what became of its observation under `best` (null: no
/// hypothesis). True if all that was measured contradicts it and a camera that agreed so far is
/// among them.
bool record_observations(Time time, std::span<const Observation> set, const Outcome* best,
                         const EstimatorOptions& options, BankState& state);

}  // namespace sightline::fuse
