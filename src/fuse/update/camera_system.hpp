// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/observation.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline::fuse {

/// One camera in one update: its observation and the weight it has.
struct CameraMeasurement {
  const Observation* observation = nullptr;
  double scale = 1.0;  ///< of the noise of its residuals: their covariance is multiplied by it
  /// How much farther the whole image is off than its corners tell (calibration, stamps): the
  /// covariance of the pose is multiplied by it once more, the residuals' is not. >= 1
  double systematic = 1.0;
  /// Variances [rad^2, m^2] of a pose error that a camera may have which was not yet compared with
  /// others; 0: none.
  double unproven_rotation = 0;
  double unproven_translation = 0;
  /// The axis of a round shape, whose outline and edges say nothing of rotations about it. Or null.
  const ShapeSymmetry::Axis* unobservable_axis = nullptr;
};

/// All terms of one camera, linearized at one pose: cost, gradient and information are divided by
/// the measurement's scales and the unknown error of the capture time is integrated out.
struct CameraSystem {
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  double cost = 0;                            ///< what the minimizer lowers
  Vector6 step_to_minimum = Vector6::Zero();  ///< as far as the camera knows one, to first order
  double own_cost = 0;   ///< at the camera's own minimum next to this pose, noise scale alone
  double pose_cost = 0;  ///< from there to this pose
  int residuals = 0;
  double quality = 0;  ///< of the terms, weighted by residuals

  /// -log likelihood of the measurement at this pose: the residuals count in full, the distance
  /// from the own minimum with both scales.
  double likelihood_cost() const { return own_cost + pose_cost; }
  /// False if the camera has nothing to say at this pose or a term gave numbers that are not
  /// finite.
  bool usable(double min_quality) const { return residuals > 0 && quality >= min_quality; }
};

/// `twist_square`: E[twist twist^T] of the body twist [rad/s, m/s]; it turns the uncertainty of the
/// capture time into one of pose.
CameraSystem linearize(const CameraMeasurement& measurement, const Rigid3& world_from_object,
                       const Matrix6& twist_square);

}  // namespace sightline::fuse
