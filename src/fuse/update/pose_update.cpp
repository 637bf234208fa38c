// SPDX-License-Identifier: Apache-2.0
#include "fuse/update/pose_update.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace sightline::fuse {
namespace {

constexpr double kConverged = 1e-7;   // squared step in units of the posterior sigma
constexpr double kMaxRotation = 0.6;  // [rad] of one step: the quadratic is worth nothing beyond
constexpr int kMaxHalvings = 6;

Matrix6 symmetric(const Matrix6& m) { return 0.5 * (m + m.transpose()); }

void evaluate(const PosePrior& prior, std::span<const CameraMeasurement> measurements,
              const Rigid3& pose, PoseMinimum& at) {
  at.pose = pose;
  at.offset = difference(prior.pose, pose);
  const Matrix6 jacobian = right_jacobian_inverse(at.offset);  // d offset / d xi
  at.prior_information = jacobian.transpose() * prior.information * jacobian;
  const Vector6 weighted = prior.information * at.offset;
  at.prior_gradient = jacobian.transpose() * weighted;
  at.prior_cost = 0.5 * at.offset.dot(weighted);
  at.cost = at.prior_cost;
  at.systems.clear();
  for (const CameraMeasurement& measurement : measurements) {
    at.systems.push_back(linearize(measurement, pose, prior.twist_square));
    at.cost += at.systems.back().cost;
  }
}

Vector6 newton_step(const PoseMinimum& at, double* decrement) {
  Vector6 gradient = at.prior_gradient;
  for (const CameraSystem& system : at.systems) gradient += system.gradient;
  Vector6 step = -at.information().ldlt().solve(gradient);
  *decrement = -step.dot(gradient);
  const double angle = step.head<3>().norm();
  if (angle > kMaxRotation) step *= kMaxRotation / angle;
  return step;
}

}  // namespace

PosePrior pose_prior(const PoseEstimate& estimate) {
  PosePrior prior;
  prior.pose = estimate.world_from_object;
  prior.covariance = symmetric(estimate.pose_covariance());
  prior.information = symmetric(prior.covariance.ldlt().solve(Matrix6::Identity()));
  prior.twist_square =
      estimate.covariance.bottomRightCorner<6, 6>() + estimate.twist * estimate.twist.transpose();
  return prior;
}

Matrix6 PoseMinimum::camera_information() const {
  Matrix6 sum = Matrix6::Zero();
  for (const CameraSystem& system : systems) sum += system.information;
  return sum;
}

Matrix6 PoseMinimum::information() const {
  return symmetric(prior_information + camera_information());
}

void Minimizer::run(const PosePrior& prior, std::span<const CameraMeasurement> measurements,
                    const Rigid3& start, PoseMinimum& result) {
  evaluate(prior, measurements, start, result);
  result.iterations = 0;
  while (result.iterations < max_iterations_) {
    double decrement = 0;
    Vector6 step = newton_step(result, &decrement);
    if (!(decrement > kConverged)) return;
    ++result.iterations;
    bool better = false;
    for (int halving = 0; halving <= kMaxHalvings && !better; ++halving, step *= 0.5) {
      evaluate(prior, measurements, result.pose * Rigid3::exp(step), trial_);
      better = trial_.cost < result.cost;
    }
    if (!better) return;
    trial_.iterations = result.iterations;
    std::swap(trial_, result);
  }
}

PoseEstimate posterior(const PoseEstimate& prior, const PoseMinimum& minimum) {
  using Matrix12 = Eigen::Matrix<double, 12, 12>;
  PoseEstimate result = prior;
  result.world_from_object = minimum.pose;

  // E[twist | pose] in the tangent of the prior.
  const Matrix6 prior_pp = symmetric(prior.pose_covariance());
  const Matrix6 prior_wp = prior.covariance.bottomLeftCorner<6, 6>();
  result.twist += prior_wp * prior_pp.ldlt().solve(minimum.offset);

  // The prior's pose error in the tangent at the new pose: xi = Jr(offset) (xi_prior - offset).
  const Matrix6 jacobian = right_jacobian(minimum.offset);
  const Matrix6 pp = symmetric(jacobian * prior_pp * jacobian.transpose());
  const Matrix6 wp = prior_wp * jacobian.transpose();
  const Matrix6 gain = pp.ldlt().solve(wp.transpose()).transpose();

  const Matrix6 posterior_pp = symmetric(minimum.information().ldlt().solve(Matrix6::Identity()));
  const Matrix6 posterior_wp = gain * posterior_pp;
  Matrix12& covariance = result.covariance;
  covariance.topLeftCorner<6, 6>() = posterior_pp;
  covariance.bottomLeftCorner<6, 6>() = posterior_wp;
  covariance.topRightCorner<6, 6>() = posterior_wp.transpose();
  covariance.bottomRightCorner<6, 6>() = symmetric(prior.covariance.bottomRightCorner<6, 6>() -
                                                   gain * (pp - posterior_pp) * gain.transpose());
  return result;
}

}  // namespace sightline::fuse
