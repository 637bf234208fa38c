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
Surprise measure_surprise(const PoseMinimum& minimum);

/// Learns the power density of acceleration from the surprise (docs/estimator.md, "Motion noise").
void adapt_motion(const Surprise& surprise, Hypothesis& hypothesis);

/// Back to the nominal density at least: nothing was learned of the motion lately.
void calm_is_over(Hypothesis& hypothesis);

}  // namespace sightline::fuse
