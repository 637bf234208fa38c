// SPDX-License-Identifier: Apache-2.0
#include "camera_system.hpp"

#include <cmath>

namespace sightline::fuse {
namespace {

// The observation belongs to capture + dt with unknown dt ~ N(0, sigma^2), so its quadratic is
// q(d + twist dt) + dt^2 / (2 sigma^2). Minimising over dt leaves a quadratic in d whose covariance
// has grown by sigma^2 twist twist^T (Sherman-Morrison; holds for singular information too).
void integrate_time_error(const Vector6& twist, double sigma, CameraSystem& system) {
  const Vector6 h_twist = system.information * twist;
  const double slope = system.gradient.dot(twist);
  const double weight = 1.0 / (1.0 / (sigma * sigma) + twist.dot(h_twist));
  system.cost -= 0.5 * weight * slope * slope;
  system.gradient -= weight * slope * h_twist;
  system.information -= weight * h_twist * h_twist.transpose();
}

}  // namespace

CameraSystem linearize(const Voter& voter, const Rigid3& world_from_object, const Vector6& twist) {
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
  const double sigma = to_seconds(voter.observation->capture_error) / std::sqrt(3.0);
  if (sigma > 0) integrate_time_error(twist, sigma, sum);
  return sum;
}

}  // namespace sightline::fuse
