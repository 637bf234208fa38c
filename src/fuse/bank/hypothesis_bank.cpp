// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/hypothesis_bank.hpp"

#include <algorithm>

#include "fuse/bank/camera_record.hpp"
#include "fuse/bank/hypothesis_selection.hpp"
#include "fuse/bank/picture_record.hpp"
#include "fuse/bank/prediction.hpp"
#include "fuse/bank/track_state.hpp"

namespace sightline::fuse {

HypothesisBank::HypothesisBank(const EstimatorOptions& options, ObjectId object,
                               const ShapeSymmetry& shape_symmetry)
    : options_(options),
      object_(object),
      symmetric_(shape_symmetry),
      hypothesis_update_(options_, symmetric_),
      track_initiation_(options_, symmetric_, object) {}

BankState HypothesisBank::nothing_known() const {
  BankState state;
  state.published.object = object_;
  return state;
}

// No camera is credited with it, so that the next set decides whether it is still seen. Poses that
// the shape cannot tell apart: if the estimate is sure of its own, so is this one.
BankState HypothesisBank::known(const PoseEstimate& estimate) const {
  BankState state = nothing_known();
  Hypothesis& hypothesis = state.hypotheses[0];
  hypothesis.estimate = estimate;
  hypothesis.estimate.object = object_;
  hypothesis.estimate.cameras = 0;
  hypothesis.estimate.alternatives.setZero();
  hypothesis.confirmations = options_.confirm_sets;
  if ((estimate.degraded_reasons & kAmbiguous) == 0) symmetric_.decide(hypothesis);
  state.count = 1;
  state.solid = (estimate.degraded_reasons & kFlatPrint) == 0;
  state.published = estimate;
  state.published.object = object_;
  state.published.cameras = 0;
  state.found_before = true;
  return state;
}

// Whether the set gives the pose in force up. Further cameras of the same detection come at times
// of their own and find the new pose in force.
bool HypothesisBank::refuted(Time time, std::span<const Observation> observations,
                             const BankState& state) const {
  constexpr double kOtherRotation = 0.25, kOtherPlace = 0.05;  // [rad, m]
  const auto refutes = [](const Observation& o) { return o.refutes; };
  if (state.count == 0 || std::none_of(observations.begin(), observations.end(), refutes)) {
    return false;
  }
  const Hypothesis& in_force = state.hypotheses[0];
  const Rigid3 pose = predicted(in_force, time, in_force.motion, options_).world_from_object;
  return std::any_of(observations.begin(), observations.end(), [&](const Observation& o) {
    if (!o.refutes || o.terms.empty() || o.hypotheses.empty()) return false;
    const Rigid3& proposed = o.hypotheses.front().world_from_object;
    return rotation_angle(pose, proposed) > kOtherRotation ||
           translation_distance(pose, proposed) > kOtherPlace;
  });
}

namespace {

// Whether the newest measurements are of outline and edges alone: those can lie on the wrong ones.
// Few points of one side say as little of its tilt.
void record_outline_only(std::span<const Observation> set, const Outcome* best, BankState& state) {
  bool any = false, outline_only = true, detected = false;
  for (const Observation& observation : set) {
    if (best == nullptr || (best->accepted & camera_bit(observation.camera)) == 0) continue;
    for (const PoseTermPtr& term : observation.terms) {
      any = true;
      const std::string_view kind = term->kind();
      outline_only &=
          kind == "region" || kind == "edge" || kind == "detection" || kind == "sparse_texture";
      detected |= kind == "detection";
    }
  }
  if (!any) return;
  state.outline_only = outline_only;
  state.detected = detected;
}

}  // namespace

void HypothesisBank::step(const BankState& before, Time time,
                          std::span<const Observation> observations, BankState& after) {
  after = before;
  after.gated = 0;
  after.iterations = 0;
  after.residual = 0;
  after.started = after.reset = false;
  expire(time, options_, after);
  if (time > held_until(after, options_) + options_.silence) after.undoubted = Duration(0);
  const bool refuted_now = refuted(time, observations, after);
  if (refuted_now) after.count = 0;
  collect(time, observations, after, symmetric_.unobservable_axis(), options_, set_);
  outcomes_.clear();
  if (!set_.measurements.empty()) {
    update(set_, after, outcomes_);
  } else {
    for (int i = 0; i < after.count; ++i) {
      Hypothesis& hypothesis = after.hypotheses[static_cast<size_t>(i)];
      hypothesis.estimate = predicted(hypothesis, time, hypothesis.motion, options_);
    }
  }
  const Outcome* best = outcomes_.empty() ? nullptr : &outcomes_.front();
  const bool contradicted = record_observations(time, observations, best, options_, after);
  after.reset |= refuted_now;
  after.started &= !refuted_now;  // it was known
  record_pictures(time, observations, best, after);
  record_outline_only(observations, best, after);
  const int outside = (doubted_ ? kContradicted : 0) | (possible_swap_ ? kPossibleSwap : 0);
  publish(time, {contradicted, static_cast<DegradedReasons>(outside)}, options_, symmetric_, after);
}

void HypothesisBank::update(const MeasurementSet& set, BankState& state,
                            std::vector<Outcome>& outcomes) {
  const bool was_empty = state.count == 0;
  if (was_empty) {
    track_initiation_.run(set, 0.0, false, outcomes);
  } else {
    for (int i = 0; i < state.count; ++i) {
      hypothesis_update_.run(state.hypotheses[static_cast<size_t>(i)], set, outcomes);
    }
    merge_and_sort(symmetric_, outcomes);
    if (needs_challenger(set.time, options_, state, outcomes)) {
      track_initiation_.run(set, state.hypotheses[0].evidence, true, outcomes);
    }
  }
  merge_and_sort(symmetric_, outcomes);
  select_hypotheses(options_, outcomes, state);
  state.started = was_empty && state.count > 0;
}

}  // namespace sightline::fuse
