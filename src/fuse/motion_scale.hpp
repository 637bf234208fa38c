// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bank_state.hpp"
#include "pose_update.hpp"

namespace sightline::fuse {

/// How far an update moved the prediction: squared Mahalanobis distance, and what it is expected to
/// be if the covariances are right.
struct Surprise {
  double squared = 0;
  double dof = 0;
};

/// The same of the whole pose and of its two halves.
struct Surprises {
  Surprise pose;
  Surprise rotation;
  Surprise translation;
};
Surprises measure_surprise(const PoseMinimum& minimum);

/// The nominal densities scaled by what was learned.
MotionNoise scaled(const MotionNoise& nominal, const MotionScale& scale);

/// Learns the power densities of acceleration from the surprise (docs/estimator.md, "Motion
/// noise").
void learn(const Surprises& surprises, MotionScale& scale);

/// The scale that would have made a surprising set normal, within [scale, at_least_nominal(scale)].
MotionScale raised(const Surprises& surprises, const MotionScale& scale);

/// Back to the nominal density at least: nothing was learned of the motion lately.
MotionScale at_least_nominal(const MotionScale& scale);

}  // namespace sightline::fuse
