// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "fuse/bank/hypothesis_update.hpp"
#include "fuse/bank/measurement_set.hpp"
#include "fuse/bank/outcome.hpp"
#include "fuse/bank/symmetric_hypotheses.hpp"
#include "fuse/bank/track_initiation.hpp"
#include "fuse/bank_state.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// The estimator without memory of its own: before + set = after. Has only scratch inside, so the
/// same input gives the same bytes.
class HypothesisBank {
 public:
  HypothesisBank(const EstimatorOptions& options, ObjectId object,
                 const ShapeSymmetry& shape_symmetry);
  HypothesisBank(const HypothesisBank&) = delete;
  HypothesisBank& operator=(const HypothesisBank&) = delete;

  /// State of an object that was never seen.
  BankState nothing_known() const;
  /// What is known where somebody else's estimate, which has a pose, is taken for right.
  BankState known(const PoseEstimate& estimate) const;
  /// `observations`: of one object at one capture time, not before the state's. `after` may not be
  /// `before`.
  void step(const BankState& before, Time time, std::span<const Observation> observations,
            BankState& after);
  /// Of the sets from now on: whether something outside speaks against the pose in force.
  void set_doubted(bool doubted) { doubted_ = doubted; }
  /// The same: whether it may be another object that looks alike.
  void set_possible_swap(bool possible) { possible_swap_ = possible; }

 private:
  bool refuted(Time time, std::span<const Observation> observations, const BankState& state) const;
  void update(const MeasurementSet& set, BankState& state, std::vector<Outcome>& outcomes);

  const EstimatorOptions options_;
  const ObjectId object_;
  const SymmetricHypotheses symmetric_;
  HypothesisUpdate hypothesis_update_;
  TrackInitiation track_initiation_;
  bool doubted_ = false, possible_swap_ = false;
  MeasurementSet set_;             // scratch of one step
  std::vector<Outcome> outcomes_;  // scratch of one step
};

}  // namespace sightline::fuse
