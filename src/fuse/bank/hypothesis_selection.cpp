// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/hypothesis_selection.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "fuse/bank/camera_record.hpp"

namespace sightline::fuse {
namespace {

constexpr double kSamePose = 4.0;  // squared Mahalanobis distance (6 dof) of one and the same

// Not yet proven poses come after the one in force whatever their evidence.
bool comes_before(const Outcome& a, const Outcome& b) {
  if (a.hypothesis.challenger != b.hypothesis.challenger) return b.hypothesis.challenger;
  return a.hypothesis.evidence < b.hypothesis.evidence;
}

// Stable, and without the buffer that std::stable_sort allocates.
void sort_outcomes(std::vector<Outcome>& outcomes) {
  for (size_t i = 1; i < outcomes.size(); ++i) {
    for (size_t j = i; j > 0 && comes_before(outcomes[j], outcomes[j - 1]); --j) {
      std::swap(outcomes[j], outcomes[j - 1]);
    }
  }
}

// Symmetric poses are one hypothesis.
bool same_pose(const SymmetricHypotheses& symmetric, const PoseEstimate& a, const PoseEstimate& b) {
  const Matrix6 covariance = a.own_covariance() + b.own_covariance();
  const Eigen::LDLT<Matrix6> metric(covariance);
  for (size_t k = 0; k < symmetric.size(); ++k) {
    const Vector6 d =
        difference(a.world_from_object, symmetric.symmetric_pose(b.world_from_object, k));
    if (d.dot(metric.solve(d)) < kSamePose) return true;
  }
  return false;
}

bool take_over(const EstimatorOptions& options, std::vector<Outcome>& outcomes) {
  const double in_force = outcomes.front().hypothesis.evidence;
  const auto proven = [&](const Outcome& o) {
    return o.hypothesis.challenger && o.hypothesis.confirmations >= options.reset_sets &&
           o.hypothesis.evidence + options.drop_margin < in_force;
  };
  if (std::none_of(outcomes.begin(), outcomes.end(), proven)) return false;
  std::erase_if(outcomes, [](const Outcome& o) { return !o.hypothesis.challenger; });
  for (Outcome& outcome : outcomes) outcome.hypothesis.challenger = false;
  sort_outcomes(outcomes);
  return true;
}

}  // namespace

void merge_and_sort(const SymmetricHypotheses& symmetric, std::vector<Outcome>& outcomes) {
  sort_outcomes(outcomes);
  for (size_t i = 0; i < outcomes.size(); ++i) {
    for (size_t j = outcomes.size() - 1; j > i; --j) {
      if (!same_pose(symmetric, outcomes[i].hypothesis.estimate, outcomes[j].hypothesis.estimate)) {
        continue;
      }
      outcomes.erase(outcomes.begin() + static_cast<ptrdiff_t>(j));
    }
  }
}

bool needs_challenger(Time time, const EstimatorOptions& options, const BankState& state,
                      std::span<const Outcome> outcomes) {
  const Outcome& best = outcomes.front();
  if (best.hypothesis.challenger || best.accepted != 0 || best.gated == 0) return false;
  for (const Outcome& outcome : outcomes) {
    if (outcome.accepted != 0) return false;  // a hypothesis explains them already
  }
  return (holding_cameras(time, options, state) & ~best.gated) == 0;
}

void select_hypotheses(const EstimatorOptions& options, std::vector<Outcome>& outcomes,
                       BankState& state) {
  state.count = 0;
  if (outcomes.empty()) return;
  state.reset = !outcomes.front().hypothesis.challenger && take_over(options, outcomes);
  const double in_force = outcomes.front().hypothesis.evidence;
  double best = in_force;
  for (const Outcome& outcome : outcomes) best = std::min(best, outcome.hypothesis.evidence);
  const auto impossible = [&](const Outcome& o) {
    if (!o.hypothesis.challenger) return o.hypothesis.evidence > in_force + options.drop_margin;
    return o.accepted == 0 || o.hypothesis.evidence > best + options.drop_margin;
  };
  outcomes.erase(std::remove_if(outcomes.begin() + 1, outcomes.end(), impossible), outcomes.end());
  const auto kept = std::min(outcomes.size(), static_cast<size_t>(options.max_hypotheses));
  const double zero = kept == 1 ? in_force : best;
  for (size_t i = 0; i < kept; ++i) {
    state.hypotheses[i] = outcomes[i].hypothesis;
    state.hypotheses[i].evidence -= zero;
  }
  state.count = static_cast<int>(kept);
}

}  // namespace sightline::fuse
