// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/rig_motion.hpp"

namespace sightline::observe {
namespace {

Vector6 twist_prior() {
  Vector6 prior;
  prior << Eigen::Vector3d::Constant(1 / (kTwistSigmaAngular * kTwistSigmaAngular)),
      Eigen::Vector3d::Constant(1 / (kTwistSigmaLinear * kTwistSigmaLinear));
  return prior;
}

}  // namespace

double twist_cost(const Vector6& twist) {
  return 0.5 * twist.dot(twist_prior().cwiseProduct(twist));
}

Matrix6x12 motion_jacobian(const Vector6& twist, double seconds) {
  Matrix6x12 out;
  out << Rigid3::exp(-twist * seconds).adjoint(), seconds * right_jacobian(twist * seconds);
  return out;
}

Matrix6x12 motion_jacobian_first_order(const Vector6& twist, double seconds) {
  Matrix6x12 out;
  out << Rigid3::exp(-twist * seconds).adjoint(), Matrix6::Identity() * seconds;
  return out;
}

MotionSystem::MotionSystem(const Vector6& twist, double prior_weight)
    : cost(prior_weight * twist_cost(twist)) {
  const Vector6 prior = prior_weight * twist_prior();
  information.diagonal().tail<6>() = prior;
  gradient.tail<6>() = prior.cwiseProduct(twist);
}

void MotionSystem::add(const LinearizedTerm& term, const Matrix6x12& by_motion) {
  information += by_motion.transpose() * term.information * by_motion;
  gradient += by_motion.transpose() * term.gradient;
  cost += term.cost;
}

}  // namespace sightline::observe
