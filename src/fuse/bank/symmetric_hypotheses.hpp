// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "fuse/bank_state.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline::fuse {

/// Which of the poses that an object's shape cannot tell apart it has. One hypothesis stands for
/// all of them, with a cost (-log probability) for each: outline and edges fit all of them in the
/// same way, so only what tells them apart is counted: colors, texture and markers.
/// docs/estimator.md.
class SymmetricHypotheses {
 public:
  explicit SymmetricHypotheses(const ShapeSymmetry& shape_symmetry);

  /// In the time to the prediction with this covariance the object may have turned from one of the
  /// poses to another.
  void allow_motion(const Matrix6& predicted_covariance, Hypothesis& hypothesis) const;
  /// Adds what a set tells; `pose`: of the hypothesis at the set's time.
  void add_evidence(std::span<const Observation> set, const Rigid3& pose,
                    Hypothesis& hypothesis) const;
  /// Moves the hypothesis to the pose that is the likeliest by far. True if that is another.
  bool choose(Hypothesis& hypothesis) const;

  /// The hypothesis' own pose is the right one.
  void decide(Hypothesis& hypothesis) const;

  /// Nothing tells which of the poses it is.
  bool ambiguous(const Hypothesis& hypothesis) const;
  /// Second moments of the other poses about the hypothesis' one, and of rotations about the axis.
  Matrix6 spread(const Hypothesis& hypothesis) const;
  /// The symmetric poses of `pose`, itself first.
  size_t size() const { return symmetries_.size(); }
  Rigid3 symmetric_pose(const Rigid3& pose, size_t index) const {
    return pose * symmetries_[index];
  }

  /// Null without one.
  const ShapeSymmetry::Axis* unobservable_axis() const { return axis_ ? &*axis_ : nullptr; }
  /// The shape does not tell the rotation about the axis: its variance is kept small and constant
  /// inside the filter (which pose of them is followed is a choice), and spread() says the rest.
  void bound_unobservable_axis(PoseEstimate& estimate) const;
  /// A turn about a near axis is measured now and then only: what was learned of the motion while
  /// it was not may not be true of it.
  void bound_motion(MotionScale& motion) const;
  /// Covariance of the rotation without the one that is declared to mean nothing.
  Eigen::Matrix3d known_rotation(const Eigen::Matrix3d& covariance) const;

 private:
  bool is_near(size_t symmetry) const { return symmetry >= first_near_; }

  bool axis_observed(const Matrix6& covariance) const;
  size_t nearest(const Eigen::Quaterniond& turn) const;
  double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) const;
  void add_surface_evidence(const Observation& observation, const Rigid3& pose,
                            SymmetryCosts& costs) const;
  void add_fiducial_evidence(const Observation& observation, const Rigid3& pose,
                             SymmetryCosts& costs) const;

  std::vector<Rigid3> symmetries_;  ///< the identity first
  bool near_axis_ = false;
  std::vector<Vector6> logs_;
  size_t first_near_ = 0;  ///< index of the first near rotation
  /// By symmetry: cost above the best from which it is out; empty: the pose itself, turned by less
  /// than the filter takes back by itself.
  std::vector<std::optional<double>> decided_;
  /// By symmetry: from a tangent at the pose to that of its logarithm at the symmetric pose.
  std::vector<Matrix6> to_symmetric_;
  std::optional<ShapeSymmetry::Axis> axis_;
};

}  // namespace sightline::fuse
