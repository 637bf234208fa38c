// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "alike_poses.hpp"
#include "bank_state.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// How long a camera's last look counts: some of its frame periods, bounded.
Duration hold(const CameraRecord& record, const EstimatorOptions& options);

/// End of the last camera's word for the object; Time::min() if none has one.
Time held_until(const BankState& state, const EstimatorOptions& options);

/// Notes for every camera of the set what its look came to under `best` (null: no hypothesis).
/// True if all that was measured contradicts it and a camera that agreed so far is among them.
bool record_looks(Time time, std::span<const Observation> set, const Outcome* best,
                  const EstimatorOptions& options, BankState& state);

/// Fills state.published from the hypotheses. While several remain, the covariance holds their
/// spread; poses that look alike are in its `alternatives`.
void publish(Time time, bool contradicted, const EstimatorOptions& options, const AlikePoses& alike,
             BankState& state);

/// What becomes of a state by the time `now` if no set comes in: coasting, lost, searching.
TrackState state_in_silence(const BankState& state, Time now, const EstimatorOptions& options);

/// Appends the entries by which a track tells of that silence, each at the time its state began.
void append_silence(const BankState& state, Time now, const EstimatorOptions& options,
                    std::vector<PoseEstimate>& track);

}  // namespace sightline::fuse
