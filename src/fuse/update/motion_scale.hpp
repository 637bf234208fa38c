// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "fuse/bank_state.hpp"
#include "fuse/update/pose_update.hpp"

namespace sightline::fuse {

/// Normalized innovation squared: how far an update moved the prediction (squared Mahalanobis
/// distance), and what it is expected to be if the covariances are right.
struct Nis {
  double squared = 0;
  double dof = 0;
};

/// The same of the whole pose and of its two halves.
struct PoseNis {
  Nis pose;
  Nis rotation;
  Nis translation;
};
PoseNis normalized_innovation(const PoseMinimum& minimum);

/// The nominal densities scaled by what was learned.
MotionNoise scaled(const MotionNoise& nominal, const MotionScale& scale);

/// Learns the power densities of acceleration: corrections of an optimal filter are white (Mehra,
/// "On the identification of variances and adaptive Kalman filtering", 1970). Corrections that go
/// on in the direction of the one before show that the filter lags, corrections that take the one
/// before back that it follows the noise, whatever the covariances claim.
void learn(Time time, const PoseMinimum& minimum, int cameras, double systematic,
           MotionMemory& memory, MotionScale& scale);

/// The scale that would have made a large innovation an expected one, within [scale,
/// at_least_nominal(scale)].
MotionScale raised(const PoseNis& nis, const MotionScale& scale);

/// Back to the nominal density at least: nothing was learned of the motion lately.
MotionScale at_least_nominal(const MotionScale& scale);

}  // namespace sightline::fuse
