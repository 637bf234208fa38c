// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/symmetric_hypotheses.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sightline::fuse {
namespace {

// Cost above the best. Stated one in a million, because pixels err together: of poses decided by
// 1000:1 to 1,000,000:1 one in eleven was wrong, beyond none (docs/accuracy.md).
constexpr double kDecided = 13.8;
// A pose of the near ones that is turned by little: as long as it is about as good, the fit is on
// its way there, and knows the turn less well than it thinks.
constexpr double kSettled = 4.0;
constexpr double kMovedTurn = 0.1;             // [rad] of a near one that was taken instead
constexpr double kMovedSpin = 2.0;             // [rad/s]
constexpr double kMinAdvantage = 4.0;          // advantage for which another pose is taken
constexpr double kMaxCost = 40.0;              // so that what was believed can be revised
constexpr double kMaxNearCost = 16.0;          // the part that tells may be hidden for long
constexpr double kLeastNearMotion = 1.0 / 16;  // of the nominal density about a near axis
constexpr double kMaxCostPerCamera = 12.0;     // in one frame
// Colors err in the same way from frame to frame, so that many weak hints prove nothing: what was
// known fades by this with each set, and a set alone must be worth kDecided * (1 - kFading).
constexpr double kFading = 0.85;
constexpr double kMarkerSigma = 0.15;  // [rad] of a pose that markers propose
constexpr double kSameSymmetry = 0.5;  // [rad]
constexpr double kSamePose = 0.3;      // [rad] turned by less, outline and edges find the way back
constexpr double kFreeRotation = 0.1;  // [rad], [rad/s] inside the filter
constexpr double kFreeSpin = 1.0;
constexpr double kAnyAngle = std::numbers::pi / std::numbers::sqrt3;  // sigma of a uniform angle

using Matrix12 = Eigen::Matrix<double, 12, 12>;

// Fiducials are fixed to the object and tell its symmetric poses apart.
bool has_fiducials(const Observation& observation) {
  return std::any_of(observation.terms.begin(), observation.terms.end(),
                     [](const PoseTermPtr& term) { return term->kind() == "fiducial"; });
}

void bound_variance(Eigen::Index first, const Eigen::Vector3d& axis, double max, Matrix12& p) {
  Eigen::Matrix<double, 12, 1> direction = Eigen::Matrix<double, 12, 1>::Zero();
  direction.segment<3>(first) = axis;
  const Eigen::Matrix<double, 12, 1> column = p * direction;
  const double variance = direction.dot(column);
  if (variance <= max * max) return;
  // As if it had been measured with just the noise that leaves `max`.
  p -= column * column.transpose() * ((1 - max * max / variance) / variance);
}

}  // namespace

SymmetricHypotheses::SymmetricHypotheses(const ShapeSymmetry& shape_symmetry)
    : near_axis_(shape_symmetry.near_axis.has_value()), axis_(shape_symmetry.axis) {
  symmetries_.emplace_back();
  for (const auto* turns : {&shape_symmetry.rotations, &shape_symmetry.near_rotations}) {
    first_near_ = symmetries_.size();
    for (const Rigid3& turn : *turns) {
      if (symmetries_.size() > ShapeSymmetry::kMax) break;
      symmetries_.push_back(turn);
    }
  }
  for (size_t k = 0; k < symmetries_.size(); ++k) {
    const Rigid3& turn = symmetries_[k];
    logs_.push_back(turn.log());
    const bool other = turn.rotation.angularDistance(Eigen::Quaterniond::Identity()) > kSamePose;
    if (other) {
      decided_.emplace_back(kDecided);
    } else {
      decided_.push_back(is_near(k) ? std::optional(kSettled) : std::nullopt);
    }
    to_symmetric_.push_back(right_jacobian_inverse(logs_.back()) * turn.inverse().adjoint());
  }
}

double SymmetricHypotheses::angle_between(const Eigen::Quaterniond& a,
                                          const Eigen::Quaterniond& b) const {
  if (!axis_) return a.angularDistance(b);
  const Eigen::Vector3d u = a * axis_->direction, v = b * axis_->direction;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

size_t SymmetricHypotheses::nearest(const Eigen::Quaterniond& turn) const {
  size_t best = 0;
  for (size_t k = 1; k < symmetries_.size(); ++k) {
    if (angle_between(turn, symmetries_[k].rotation) <
        angle_between(turn, symmetries_[best].rotation))
      best = k;
  }
  return best;
}

void SymmetricHypotheses::decide(Hypothesis& hypothesis) const {
  SymmetryCosts& costs = hypothesis.symmetry_costs;
  costs[0] = 0;
  for (size_t k = 1; k < symmetries_.size(); ++k) costs[k] = is_near(k) ? kMaxNearCost : kMaxCost;
}

void SymmetricHypotheses::allow_motion(const Matrix6& predicted_covariance,
                                       Hypothesis& hypothesis) const {
  if (symmetries_.size() == 1) return;
  const Eigen::LDLT<Matrix6> metric(predicted_covariance);
  SymmetryCosts& costs = hypothesis.symmetry_costs;
  for (size_t k = 1; k < symmetries_.size(); ++k) {
    costs[k] = std::min(costs[k], costs[0] + 0.5 * logs_[k].dot(metric.solve(logs_[k])));
  }
}

void SymmetricHypotheses::add_surface_evidence(const Observation& observation, const Rigid3& pose,
                                               SymmetryCosts& costs) const {
  SymmetryCosts own;
  own.fill(std::numeric_limits<double>::infinity());
  double min = own[0], max = 0;
  for (const PoseHypothesis& entry : observation.symmetric_hypotheses) {
    const Eigen::Quaterniond turn = pose.rotation.conjugate() * entry.world_from_object.rotation;
    const size_t k = nearest(turn);
    if (angle_between(turn, symmetries_[k].rotation) > kSameSymmetry) continue;
    own[k] = std::min(own[k], entry.cost);
    min = std::min(min, entry.cost);
    max = std::max(max, entry.cost);
  }
  if (!std::isfinite(min)) return;
  for (size_t k = 0; k < symmetries_.size(); ++k) {
    // A pose that was not compared is as unlikely as the least likely one.
    const double cost = std::isfinite(own[k]) ? own[k] : max;
    costs[k] += std::min(cost - min, kMaxCostPerCamera);
  }
}

void SymmetricHypotheses::add_fiducial_evidence(const Observation& observation, const Rigid3& pose,
                                                SymmetryCosts& costs) const {
  double best = std::numeric_limits<double>::infinity();
  for (const PoseHypothesis& proposed : observation.hypotheses) {
    best = std::min(best, proposed.cost);
  }
  for (size_t k = 0; k < symmetries_.size(); ++k) {
    double min = kMaxCostPerCamera;
    for (const PoseHypothesis& proposed : observation.hypotheses) {
      const double off =
          angle_between((pose * symmetries_[k]).rotation, proposed.world_from_object.rotation);
      min = std::min(min, proposed.cost - best + 0.5 * std::pow(off / kMarkerSigma, 2));
    }
    costs[k] += min;
  }
}

void SymmetricHypotheses::add_evidence(std::span<const Observation> set, const Rigid3& pose,
                                       Hypothesis& hypothesis) const {
  if (symmetries_.size() == 1) return;
  SymmetryCosts& costs = hypothesis.symmetry_costs;
  const bool colors = std::any_of(
      set.begin(), set.end(), [](const Observation& o) { return !o.symmetric_hypotheses.empty(); });
  if (colors && ambiguous(hypothesis)) {
    for (size_t k = 0; k < symmetries_.size(); ++k) costs[k] *= kFading;
  }
  for (const Observation& observation : set) {
    if (!observation.symmetric_hypotheses.empty()) add_surface_evidence(observation, pose, costs);
    if (!observation.hypotheses.empty() && has_fiducials(observation)) {
      add_fiducial_evidence(observation, pose, costs);
    }
  }
  const double min =
      *std::min_element(costs.begin(), costs.begin() + static_cast<ptrdiff_t>(symmetries_.size()));
  for (size_t k = 0; k < symmetries_.size(); ++k) {
    costs[k] = std::min(costs[k] - min, is_near(k) ? kMaxNearCost : kMaxCost);
  }
}

bool SymmetricHypotheses::choose(Hypothesis& hypothesis) const {
  const SymmetryCosts before = hypothesis.symmetry_costs;
  const auto end = before.begin() + static_cast<ptrdiff_t>(symmetries_.size());
  const auto chosen = static_cast<size_t>(std::min_element(before.begin(), end) - before.begin());
  if (before[chosen] + kMinAdvantage > before[0]) return false;
  const Rigid3& turn = symmetries_[chosen];
  const Matrix6 forth = turn.adjoint(), back = turn.inverse().adjoint();
  PoseEstimate& estimate = hypothesis.estimate;
  estimate.world_from_object = estimate.world_from_object * turn;
  estimate.twist = back * estimate.twist;
  Matrix12 both = Matrix12::Zero();
  both.topLeftCorner<6, 6>() = back;
  both.bottomRightCorner<6, 6>() = back;
  estimate.covariance = (both * estimate.covariance * both.transpose()).eval();
  if (is_near(chosen)) {
    // The pose had turned away from the object: its spin is as wrong, and the steps are coarse.
    const Vector6 about = logs_[chosen] / logs_[chosen].head<3>().norm();
    estimate.covariance.topLeftCorner<6, 6>() +=
        kMovedTurn * kMovedTurn * about * about.transpose();
    estimate.covariance.bottomRightCorner<6, 6>() +=
        kMovedSpin * kMovedSpin * about * about.transpose();
  }
  hypothesis.corrections.offset = back * hypothesis.corrections.offset;
  hypothesis.corrections.before = back * hypothesis.corrections.before;
  hypothesis.systematic_information =
      (forth.transpose() * hypothesis.systematic_information * forth).eval();
  for (size_t k = 0; k < symmetries_.size(); ++k) {
    hypothesis.symmetry_costs[k] = before[nearest((turn * symmetries_[k]).rotation)];
  }
  return true;
}

bool SymmetricHypotheses::ambiguous(const Hypothesis& hypothesis) const {
  for (size_t k = 1; k < symmetries_.size(); ++k) {
    if (decided_[k] && hypothesis.symmetry_costs[k] < hypothesis.symmetry_costs[0] + *decided_[k]) {
      return true;
    }
  }
  return false;
}

Matrix6 SymmetricHypotheses::spread(const Hypothesis& hypothesis) const {
  const Matrix6 known = hypothesis.estimate.own_covariance();
  Matrix6 sum = Matrix6::Zero();
  // Decided is decided: the rest would be a tail that no second moment describes.
  if (ambiguous(hypothesis)) {
    double total = 0;
    for (size_t k = 0; k < symmetries_.size(); ++k) {
      const double weight = std::exp(hypothesis.symmetry_costs[0] - hypothesis.symmetry_costs[k]);
      // A small error at the pose is one of the symmetric pose too.
      sum += weight * (logs_[k] * logs_[k].transpose() +
                       to_symmetric_[k] * known * to_symmetric_[k].transpose() - known);
      total += weight;
    }
    sum /= std::max(total, 1.0);
  }
  if (axis_ && !axis_observed(known)) {
    Vector6 turn;
    turn << axis_->direction, axis_->point.cross(axis_->direction);
    sum += kAnyAngle * kAnyAngle * turn * turn.transpose();
  }
  return sum;
}

// Markers or texture may tell the rotation about the axis all the same.
bool SymmetricHypotheses::axis_observed(const Matrix6& covariance) const {
  const Eigen::Vector3d& axis = axis_->direction;
  const double variance = axis.dot(covariance.topLeftCorner<3, 3>() * axis);
  return variance < 0.25 * kFreeRotation * kFreeRotation;
}

void SymmetricHypotheses::bound_unobservable_axis(PoseEstimate& estimate) const {
  if (!axis_) return;
  bound_variance(0, axis_->direction, kFreeRotation, estimate.covariance);
  bound_variance(6, axis_->direction, kFreeSpin, estimate.covariance);
}

void SymmetricHypotheses::bound_motion(MotionScale& motion) const {
  if (near_axis_) motion.angular = std::max(motion.angular, kLeastNearMotion);
}

Eigen::Matrix3d SymmetricHypotheses::known_rotation(const Eigen::Matrix3d& covariance) const {
  if (!axis_ || !axis_->declared) return covariance;
  const Eigen::Matrix3d across =
      Eigen::Matrix3d::Identity() - axis_->direction * axis_->direction.transpose();
  return across * covariance * across;
}

}  // namespace sightline::fuse
