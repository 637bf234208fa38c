// SPDX-License-Identifier: Apache-2.0
#include "fuse/update/camera_system.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace sightline::fuse {
namespace {

// The observation is off by an unknown pose error of covariance V =: spread besides its own. With
// W = (I + information V)^-1 the quadratic of the sum is  information' = W information,  gradient'
// = W gradient  and a cost lowered by gradient^T V W gradient / 2 (matrix inversion lemma; holds
// for singular information too).
void integrate_out(const Matrix6& spread, CameraSystem& system) {
  const Eigen::PartialPivLU<Matrix6> mix(Matrix6::Identity() + system.information * spread);
  const Vector6 gradient = mix.solve(system.gradient);
  const Matrix6 information = mix.solve(system.information);
  system.cost -= 0.5 * system.gradient.dot(spread * gradient);
  system.gradient = gradient;
  system.information = 0.5 * (information + information.transpose());
}

// Step to the camera's own minimum, as far as it knows one: directions without information stay.
Vector6 minimum_step(const CameraSystem& system) {
  const Vector6 size = system.information.diagonal().cwiseMax(1e-12);
  Matrix6 damped = system.information;
  damped.diagonal() += 1e-9 * size;
  return -damped.ldlt().solve(system.gradient);
}

bool sees_shape_only(const PoseTerm& term) {
  const std::string_view kind = term.kind();
  return kind != "fiducial" && kind != "texture" && kind != "sparse_texture" && kind != "frozen";
}

// The facets of a round mesh would tell what its object does not show. A turn about the axis is the
// tangent u = (direction, point x direction) and is measured by s = (direction, 0): s^T u = 1. With
// M = I - u s^T, which leaves nothing of it,  information' = M^T information M.
void remove_rotation_about(const ShapeSymmetry::Axis& axis, LinearizedTerm& term) {
  Vector6 u, s;
  u << axis.direction, axis.point.cross(axis.direction);
  s << axis.direction, Eigen::Vector3d::Zero();
  const Matrix6 kept = Matrix6::Identity() - u * s.transpose();
  term.information = (kept.transpose() * term.information * kept).eval();
  term.gradient = (kept.transpose() * term.gradient).eval();
}

}  // namespace

CameraSystem linearize(const CameraMeasurement& measurement, const Rigid3& world_from_object,
                       const Matrix6& twist_square) {
  CameraSystem sum;
  double cost = 0;
  for (const PoseTermPtr& term : measurement.observation->terms) {
    LinearizedTerm part = term->linearize(world_from_object);
    if (part.residuals <= 0) continue;
    if (!std::isfinite(part.cost) || !part.gradient.allFinite() || !part.information.allFinite()) {
      return {};
    }
    if (measurement.unobservable_axis != nullptr && sees_shape_only(*term)) {
      remove_rotation_about(*measurement.unobservable_axis, part);
    }
    sum.information += part.information;
    sum.gradient += part.gradient;
    cost += part.cost;
    sum.residuals += part.residuals;
    sum.quality += part.quality * part.residuals;
  }
  if (sum.residuals == 0) return sum;
  sum.quality /= sum.residuals;
  sum.step_to_minimum = minimum_step(sum);
  const double drop = -0.5 * sum.gradient.dot(sum.step_to_minimum);
  sum.own_cost = std::max(0.0, cost - drop) / measurement.scale;
  const double weight = 1.0 / (measurement.scale * measurement.systematic);
  sum.information *= weight;
  sum.gradient *= weight;
  sum.cost = cost * weight;
  // A capture time that is off by dt, of which a bound is known (taken as a uniform distribution),
  // moves the pose by twist * dt.
  const double bound = to_seconds(measurement.observation->capture_error);
  const Matrix6* extra = measurement.observation->calibration_covariance.get();
  if (bound > 0 || measurement.unproven_translation > 0 || extra != nullptr) {
    Matrix6 spread = bound * bound / 3.0 * twist_square;
    spread.diagonal().head<3>().array() += measurement.unproven_rotation;
    spread.diagonal().tail<3>().array() += measurement.unproven_translation;
    if (extra != nullptr) spread += world_from_object.inverse().covariance_in_target(*extra);
    integrate_out(spread, sum);
  }
  sum.pose_cost = -0.5 * sum.gradient.dot(sum.step_to_minimum);
  return sum;
}

}  // namespace sightline::fuse
