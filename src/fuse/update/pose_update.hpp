// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "fuse/update/camera_system.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline::fuse {

/// Gaussian over poses: pose * exp(xi), xi ~ N(0, information^-1).
struct PosePrior {
  Rigid3 pose;
  Matrix6 covariance;
  Matrix6 information;
  Matrix6 twist_square;  ///< E[twist twist^T], for the uncertainty of capture times
};
PosePrior pose_prior(const PoseEstimate& estimate);

/// Minimum over the pose of  prior + sum of cameras.
struct PoseMinimum {
  Rigid3 pose;
  Vector6 offset = Vector6::Zero();             ///< log(prior.pose^-1 * pose)
  Matrix6 prior_information = Matrix6::Zero();  ///< of the prior, in the tangent at `pose`
  Vector6 prior_gradient = Vector6::Zero();
  double prior_cost = 0;
  double cost = 0;                    ///< prior and cameras
  std::vector<CameraSystem> systems;  ///< at `pose`, in the order of the measurements
  int iterations = 0;

  /// Of the prior and all cameras.
  Matrix6 information() const;
  /// Of all cameras.
  Matrix6 camera_information() const;
};

/// Gauss-Newton with step halving from `start`, linearized anew at every step (the iterated Kalman
/// update: Bell and Cathey, 1993). Cameras that are not usable at a pose count as silent there.
class Minimizer {
 public:
  explicit Minimizer(int max_iterations) : max_iterations_(max_iterations) {}
  /// `result` is reused, so that nothing is allocated after warm-up.
  void run(const PosePrior& prior, std::span<const CameraMeasurement> measurements,
           const Rigid3& start, PoseMinimum& result);

 private:
  int max_iterations_;
  PoseMinimum trial_;
};

/// The estimate after the update: pose and covariance from the minimum, twist by regression on the
/// pose; the covariance is that of the tangent at the new pose.
PoseEstimate posterior(const PoseEstimate& prior, const PoseMinimum& minimum);

}  // namespace sightline::fuse
