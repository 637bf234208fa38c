// SPDX-License-Identifier: Apache-2.0
#include "camera_system.hpp"

#include <Eigen/LU>
#include <cmath>

namespace sightline::fuse {
namespace {

// The observation belongs to capture + dt with unknown dt of variance v, so its pose error has the
// covariance v E[twist twist^T] =: V besides its own. With W = (I + information V)^-1 the quadratic
// of the sum is  information' = W information,  gradient' = W gradient  and a cost lowered by
// gradient^T V W gradient / 2 (matrix inversion lemma; holds for singular information too).
void integrate_time_error(const Matrix6& twist_square, double variance, CameraSystem& system) {
  const Matrix6 spread = variance * twist_square;
  const Eigen::PartialPivLU<Matrix6> mix(Matrix6::Identity() + system.information * spread);
  const Vector6 gradient = mix.solve(system.gradient);
  const Matrix6 information = mix.solve(system.information);
  system.cost -= 0.5 * system.gradient.dot(spread * gradient);
  system.gradient = gradient;
  system.information = 0.5 * (information + information.transpose());
}

}  // namespace

CameraSystem linearize(const Voter& voter, const Rigid3& world_from_object,
                       const Matrix6& twist_square) {
  CameraSystem sum;
  for (const PoseTermPtr& term : voter.observation->terms) {
    const LinearizedTerm part = term->linearize(world_from_object);
    if (part.residuals <= 0) continue;
    if (!std::isfinite(part.cost) || !part.gradient.allFinite() || !part.information.allFinite()) {
      return {};
    }
    sum.information += part.information;
    sum.gradient += part.gradient;
    sum.raw_cost += part.cost;
    sum.residuals += part.residuals;
    sum.quality += part.quality * part.residuals;
  }
  if (sum.residuals == 0) return sum;
  sum.quality /= sum.residuals;
  const double weight = 1.0 / voter.scale;
  sum.information *= weight;
  sum.gradient *= weight;
  sum.cost = sum.raw_cost * weight;
  // A bound on the error is taken as a uniform distribution.
  const double bound = to_seconds(voter.observation->capture_error);
  if (bound > 0) integrate_time_error(twist_square, bound * bound / 3.0, sum);
  return sum;
}

}  // namespace sightline::fuse
