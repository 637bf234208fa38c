// SPDX-License-Identifier: Apache-2.0
#include "alike_poses.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sightline::fuse {
namespace {

constexpr double kDecided = 8.0;     // cost above the best: one in three thousand
constexpr double kToChange = 4.0;    // advantage for which another pose is taken
constexpr double kMostCost = 40.0;   // so that what was believed can be revised
constexpr double kMostOfOne = 12.0;  // of one camera's look
// Looks at colours are alike from frame to frame, so that many weak ones prove nothing: what was
// known fades by this with each set, and a set alone must be worth kDecided * (1 - kKept).
constexpr double kKept = 0.85;
constexpr double kMarkerSigma = 0.15;  // [rad] of a pose that markers propose
constexpr double kSameTurn = 0.5;      // [rad]
constexpr double kFreeRotation = 0.1;  // [rad], [rad/s] inside the filter
constexpr double kFreeSpin = 1.0;
constexpr double kAnyAngle = std::numbers::pi / std::numbers::sqrt3;  // sigma of a uniform angle

using Matrix12 = Eigen::Matrix<double, 12, 12>;

// Kinds of terms that measure what an object carries, not what it looks like from afar.
bool tells_sides(const Observation& observation) {
  return std::any_of(observation.terms.begin(), observation.terms.end(),
                     [](const PoseTermPtr& term) { return term->kind() == "fiducial"; });
}

void bound_variance(Eigen::Index first, const Eigen::Vector3d& axis, double most, Matrix12& p) {
  Eigen::Matrix<double, 12, 1> direction = Eigen::Matrix<double, 12, 1>::Zero();
  direction.segment<3>(first) = axis;
  const Eigen::Matrix<double, 12, 1> column = p * direction;
  const double variance = direction.dot(column);
  if (variance <= most * most) return;
  // As if it had been measured with just the noise that leaves `most`.
  p -= column * column.transpose() * ((1 - most * most / variance) / variance);
}

}  // namespace

AlikePoses::AlikePoses(const Lookalikes& lookalikes) : axis_(lookalikes.axis) {
  turns_.emplace_back();
  for (const Rigid3& turn : lookalikes.turns) {
    if (turns_.size() > Lookalikes::kMost) break;
    turns_.push_back(turn);
  }
  for (const Rigid3& turn : turns_) {
    logs_.push_back(turn.log());
    carried_.push_back(right_jacobian_inverse(logs_.back()) * turn.inverse().adjoint());
  }
}

double AlikePoses::apart(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) const {
  if (!axis_) return a.angularDistance(b);
  const Eigen::Vector3d u = a * axis_->direction, v = b * axis_->direction;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

size_t AlikePoses::nearest(const Eigen::Quaterniond& turn) const {
  size_t best = 0;
  for (size_t k = 1; k < turns_.size(); ++k) {
    if (apart(turn, turns_[k].rotation) < apart(turn, turns_[best].rotation)) best = k;
  }
  return best;
}

void AlikePoses::forget(Hypothesis& hypothesis) const { hypothesis.turn_costs.fill(0); }

void AlikePoses::allow_motion(const Matrix6& predicted_covariance, Hypothesis& hypothesis) const {
  if (turns_.size() == 1) return;
  const Eigen::LDLT<Matrix6> metric(predicted_covariance);
  TurnCosts& costs = hypothesis.turn_costs;
  for (size_t k = 1; k < turns_.size(); ++k) {
    costs[k] = std::min(costs[k], costs[0] + 0.5 * logs_[k].dot(metric.solve(logs_[k])));
  }
}

void AlikePoses::take_colours(const Observation& observation, const Rigid3& pose,
                              TurnCosts& costs) const {
  TurnCosts own;
  own.fill(std::numeric_limits<double>::infinity());
  double least = own[0], most = 0;
  for (const PoseHypothesis& entry : observation.alike) {
    const Eigen::Quaterniond turn = pose.rotation.conjugate() * entry.world_from_object.rotation;
    const size_t k = nearest(turn);
    if (apart(turn, turns_[k].rotation) > kSameTurn) continue;
    own[k] = std::min(own[k], entry.cost);
    least = std::min(least, entry.cost);
    most = std::max(most, entry.cost);
  }
  if (!std::isfinite(least)) return;
  for (size_t k = 0; k < turns_.size(); ++k) {
    // A pose that nobody looked at is as unlikely as the least likely one.
    const double cost = std::isfinite(own[k]) ? own[k] : most;
    costs[k] += std::min(cost - least, kMostOfOne);
  }
}

void AlikePoses::take_markers(const Observation& observation, const Rigid3& pose,
                              TurnCosts& costs) const {
  double best = std::numeric_limits<double>::infinity();
  for (const PoseHypothesis& proposed : observation.hypotheses) {
    best = std::min(best, proposed.cost);
  }
  for (size_t k = 0; k < turns_.size(); ++k) {
    double least = kMostOfOne;
    for (const PoseHypothesis& proposed : observation.hypotheses) {
      const double off = apart((pose * turns_[k]).rotation, proposed.world_from_object.rotation);
      least = std::min(least, proposed.cost - best + 0.5 * std::pow(off / kMarkerSigma, 2));
    }
    costs[k] += least;
  }
}

void AlikePoses::take(std::span<const Observation> set, const Rigid3& pose,
                      Hypothesis& hypothesis) const {
  if (turns_.size() == 1) return;
  TurnCosts& costs = hypothesis.turn_costs;
  const bool colours =
      std::any_of(set.begin(), set.end(), [](const Observation& o) { return !o.alike.empty(); });
  if (colours && ambiguous(hypothesis)) {
    for (size_t k = 0; k < turns_.size(); ++k) costs[k] *= kKept;
  }
  for (const Observation& observation : set) {
    if (!observation.alike.empty()) take_colours(observation, pose, costs);
    if (!observation.hypotheses.empty() && tells_sides(observation)) {
      take_markers(observation, pose, costs);
    }
  }
  const double least =
      *std::min_element(costs.begin(), costs.begin() + static_cast<ptrdiff_t>(turns_.size()));
  for (size_t k = 0; k < turns_.size(); ++k) costs[k] = std::min(costs[k] - least, kMostCost);
}

bool AlikePoses::choose(Hypothesis& hypothesis) const {
  const TurnCosts before = hypothesis.turn_costs;
  const auto end = before.begin() + static_cast<ptrdiff_t>(turns_.size());
  const auto chosen = static_cast<size_t>(std::min_element(before.begin(), end) - before.begin());
  if (before[chosen] + kToChange > before[0]) return false;
  const Rigid3& turn = turns_[chosen];
  const Matrix6 forth = turn.adjoint(), back = turn.inverse().adjoint();
  PoseEstimate& estimate = hypothesis.estimate;
  estimate.world_from_object = estimate.world_from_object * turn;
  estimate.twist = back * estimate.twist;
  Matrix12 both = Matrix12::Zero();
  both.topLeftCorner<6, 6>() = back;
  both.bottomRightCorner<6, 6>() = back;
  estimate.covariance = (both * estimate.covariance * both.transpose()).eval();
  hypothesis.corrections.offset = back * hypothesis.corrections.offset;
  hypothesis.corrections.before = back * hypothesis.corrections.before;
  hypothesis.systematic_information =
      (forth.transpose() * hypothesis.systematic_information * forth).eval();
  for (size_t k = 0; k < turns_.size(); ++k) {
    hypothesis.turn_costs[k] = before[nearest((turn * turns_[k]).rotation)];
  }
  return true;
}

bool AlikePoses::ambiguous(const Hypothesis& hypothesis) const {
  for (size_t k = 1; k < turns_.size(); ++k) {
    if (hypothesis.turn_costs[k] < hypothesis.turn_costs[0] + kDecided) return true;
  }
  return false;
}

Matrix6 AlikePoses::spread(const Hypothesis& hypothesis) const {
  const Matrix6 known = hypothesis.estimate.own_covariance();
  Matrix6 sum = Matrix6::Zero();
  double total = 0;
  for (size_t k = 0; k < turns_.size(); ++k) {
    const double weight = std::exp(hypothesis.turn_costs[0] - hypothesis.turn_costs[k]);
    // A small error at the pose is one of the turned pose too.
    sum += weight * (logs_[k] * logs_[k].transpose() +
                     carried_[k] * known * carried_[k].transpose() - known);
    total += weight;
  }
  // Decided is decided: the rest would be a tail that no second moment describes.
  if (turns_.size() == 1 || !ambiguous(hypothesis)) sum.setZero();
  sum /= std::max(total, 1.0);
  if (axis_ && !told(known)) {
    Vector6 turn;
    turn << axis_->direction, axis_->point.cross(axis_->direction);
    sum += kAnyAngle * kAnyAngle * turn * turn.transpose();
  }
  return sum;
}

// Markers or print tell the turn about the axis all the same.
bool AlikePoses::told(const Matrix6& covariance) const {
  const Eigen::Vector3d& axis = axis_->direction;
  const double variance = axis.dot(covariance.topLeftCorner<3, 3>() * axis);
  return variance < 0.25 * kFreeRotation * kFreeRotation;
}

void AlikePoses::bound_blind_axis(PoseEstimate& estimate) const {
  if (!axis_) return;
  bound_variance(0, axis_->direction, kFreeRotation, estimate.covariance);
  bound_variance(6, axis_->direction, kFreeSpin, estimate.covariance);
}

Eigen::Matrix3d AlikePoses::known_rotation(const Eigen::Matrix3d& covariance) const {
  if (!axis_ || !axis_->declared) return covariance;
  const Eigen::Matrix3d across =
      Eigen::Matrix3d::Identity() - axis_->direction * axis_->direction.transpose();
  return across * covariance * across;
}

}  // namespace sightline::fuse
