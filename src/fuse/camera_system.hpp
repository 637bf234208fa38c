// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/observation.hpp"

namespace sightline::fuse {

/// One camera in one update: its observation and how far its word counts.
struct Voter {
  const Observation* observation = nullptr;
  double scale = 1.0;  ///< its covariance is multiplied by this (>= 1)
};

/// All terms of one camera, linearised at one pose: cost, gradient and information are divided by
/// the voter's scale and the unknown error of the capture time is integrated out.
struct CameraSystem {
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  double cost = 0;
  double raw_cost = 0;  ///< before scale and time
  int residuals = 0;
  double quality = 0;  ///< of the terms, weighted by residuals

  /// False if the camera has nothing to say at this pose or a term gave numbers that are not
  /// finite.
  bool usable(double min_quality) const { return residuals > 0 && quality >= min_quality; }
};

/// `twist_square`: E[twist twist^T] of the body twist [rad/s, m/s]; it turns the uncertainty of the
/// capture time into one of pose.
CameraSystem linearize(const Voter& voter, const Rigid3& world_from_object,
                       const Matrix6& twist_square);

}  // namespace sightline::fuse
