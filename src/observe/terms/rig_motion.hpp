// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/pose_term.hpp"

namespace sightline::observe {

using Matrix12 = Eigen::Matrix<double, 12, 12>;
using Matrix6x12 = Eigen::Matrix<double, 6, 12>;
using Vector12 = Eigen::Matrix<double, 12, 1>;

/// An object's motion through several images: where it is at the reference time and its twist
/// (body frame). At an image's own time it is at world_from_object * exp(twist * seconds).
struct RigMotion {
  Rigid3 world_from_object;
  Vector6 twist = Vector6::Zero();  ///< [rad/s, m/s]

  Rigid3 at(double seconds) const { return world_from_object * Rigid3::exp(twist * seconds); }
};

/// Prior of a twist about zero, one sigma: what is moved by hand or by a robot near people.
constexpr double kTwistSigmaAngular = 3.5;  // [rad/s]
constexpr double kTwistSigmaLinear = 1.0;   // [m/s]
/// Half the squared twist by its prior.
double twist_cost(const Vector6& twist);

/// Tangent of an image's pose by that of (pose, twist) at the reference time:
///     Ad(exp(-twist s)) d_pose + s J_r(twist s) d_twist      (Sola et al., 2018)
/// The first-order form takes J_r for the identity.
Matrix6x12 motion_jacobian(const Vector6& twist, double seconds);
Matrix6x12 motion_jacobian_first_order(const Vector6& twist, double seconds);

/// What the terms of several images say together of a motion: with d the tangent of (pose, twist),
/// cost + gradient . d + d . information d / 2. Starts as the prior of the twist.
struct MotionSystem {
  Matrix12 information = Matrix12::Zero();
  Vector12 gradient = Vector12::Zero();
  double cost = 0;

  explicit MotionSystem(const Vector6& twist, double prior_weight = 1);
  /// Of one image, linearized at the motion's pose at its time.
  void add(const LinearizedTerm& term, const Matrix6x12& by_motion);
};

}  // namespace sightline::observe
