// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/prediction.hpp"

#include "fuse/update/motion_scale.hpp"

namespace sightline::fuse {

PoseEstimate predicted(const Hypothesis& hypothesis, Time time, const MotionScale& motion,
                       const EstimatorOptions& options) {
  PoseEstimate estimate = hypothesis.estimate;
  if (time != estimate.time) estimate = predict(estimate, time, scaled(options.noise, motion));
  estimate.cameras = 0;
  return estimate;
}

void expire(Time time, const EstimatorOptions& options, BankState& state) {
  int kept = 0;
  for (int i = 0; i < state.count; ++i) {
    const Hypothesis old = state.hypotheses[static_cast<size_t>(i)];
    const Duration age = time - old.estimate.last_measured;
    if (age > options.lost_after) continue;
    state.hypotheses[static_cast<size_t>(kept)] = old;
    // What was learned of the motion does not outlast a gap.
    if (age > options.max_hold) {
      MotionScale& motion = state.hypotheses[static_cast<size_t>(kept)].motion;
      motion = at_least_nominal(motion);
    }
    ++kept;
  }
  state.count = kept;
  // A challenger that outlives the pose it contradicted has nothing left to challenge.
  if (kept > 0 && state.hypotheses[0].challenger) {
    for (Hypothesis& hypothesis : state.hypotheses) hypothesis.challenger = false;
  }
}

}  // namespace sightline::fuse
