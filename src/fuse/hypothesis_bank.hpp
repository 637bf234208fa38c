// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "alike_poses.hpp"
#include "bank_state.hpp"
#include "sightline/fuse/estimator.hpp"
#include "vote.hpp"

namespace sightline::fuse {

/// The estimator without memory of its own: before + set = after. Has only scratch inside, so the
/// same input gives the same bytes.
class HypothesisBank {
 public:
  HypothesisBank(const EstimatorOptions& options, ObjectId object, const Lookalikes& lookalikes);

  /// State of an object that was never seen.
  BankState nothing_known() const;
  /// `set`: observations of one object at one capture time, not before the state's. `after` may not
  /// be `before`.
  void step(const BankState& before, Time time, std::span<const Observation> set, BankState& after);

 private:
  void expire(Time time, BankState& state) const;
  PoseEstimate moved_to(Time time, const Hypothesis& hypothesis, const MotionScale& motion) const;
  void collect_voters(Time time, std::span<const Observation> set, const BankState& state);
  Hypothesis with_sides(const Hypothesis& hypothesis, Time time) const;
  bool same_pose(const PoseEstimate& a, const PoseEstimate& b) const;
  void follow(const Hypothesis& known, Time time);
  void follow_loose(const Hypothesis& moved, Time time);
  MotionScale wanted_scale(const MotionScale& motion) const;
  void start(Time time, double evidence, bool challenger);
  void start_from(const Voter& proposer, const Rigid3& pose, Time time, double evidence,
                  bool challenger);
  void add_systematic(Matrix6& information) const;
  void add_outcome(const Hypothesis& moved, Time time);
  void sort_outcomes();
  void merge_and_sort();
  bool take_over();
  void settle(BankState& state);
  bool needs_challenger(Time time, const BankState& state) const;
  bool too_loose(const PoseEstimate& estimate) const;

  EstimatorOptions options_;
  ObjectId object_;
  AlikePoses alike_;
  Vote vote_;
  double surprise_limit_;  ///< squared Mahalanobis distance from the prediction
  Verdict verdict_;
  Verdict calm_verdict_;
  std::vector<Voter> voters_;
  std::span<const Observation> set_;  ///< under way
  int holding_ = 0;  ///< cameras that see the object now or did at their newest look
  std::vector<Voter> others_;
  std::vector<Outcome> outcomes_;
};

}  // namespace sightline::fuse
