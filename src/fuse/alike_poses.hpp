// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "bank_state.hpp"
#include "sightline/model/lookalikes.hpp"
#include "sightline/model/observation.hpp"

namespace sightline::fuse {

/// Which of the poses that an object's shape cannot tell apart it has. One hypothesis stands for
/// all of them, with a cost (-log probability) for each: outline and edges fit all alike, so only
/// what tells them apart is counted: colours, print and markers. docs/estimator.md.
class AlikePoses {
 public:
  explicit AlikePoses(const Lookalikes& lookalikes);

  /// Costs of a start: nothing is known.
  void forget(Hypothesis& hypothesis) const;
  /// In the time to the prediction with this covariance the object may have turned from one of the
  /// poses to another.
  void allow_motion(const Matrix6& predicted_covariance, Hypothesis& hypothesis) const;
  /// Adds what a set tells; `pose`: of the hypothesis at the set's time.
  void take(std::span<const Observation> set, const Rigid3& pose, Hypothesis& hypothesis) const;
  /// Moves the hypothesis to the pose that is the likeliest by far. True if that is another.
  bool choose(Hypothesis& hypothesis) const;

  /// Nothing tells which of the poses it is.
  bool ambiguous(const Hypothesis& hypothesis) const;
  /// Second moments of the other poses about the hypothesis' one, and of turns about the axis.
  Matrix6 spread(const Hypothesis& hypothesis) const;
  /// `pose` turned by all that looks alike, itself first.
  size_t size() const { return turns_.size(); }
  Rigid3 turned(const Rigid3& pose, size_t index) const { return pose * turns_[index]; }

  /// Null without one.
  const Lookalikes::Axis* blind_axis() const { return axis_ ? &*axis_ : nullptr; }
  /// The shape does not tell the turn about the axis: its variance is kept small and constant
  /// inside the filter (which pose of them is followed is a choice), and spread() says the rest.
  void bound_blind_axis(PoseEstimate& estimate) const;
  /// Covariance of the rotation without turns that are declared to mean nothing.
  Eigen::Matrix3d known_rotation(const Eigen::Matrix3d& covariance) const;

 private:
  bool told(const Matrix6& covariance) const;
  size_t nearest(const Eigen::Quaterniond& turn) const;
  double apart(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) const;
  void take_colours(const Observation& observation, const Rigid3& pose, TurnCosts& costs) const;
  void take_markers(const Observation& observation, const Rigid3& pose, TurnCosts& costs) const;

  std::vector<Rigid3> turns_;  ///< the identity first
  std::vector<Vector6> logs_;
  /// By turn: from a tangent at the pose to that of log(turn) at the turned one.
  std::vector<Matrix6> carried_;
  std::optional<Lookalikes::Axis> axis_;
};

}  // namespace sightline::fuse
