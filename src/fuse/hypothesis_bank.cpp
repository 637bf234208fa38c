// SPDX-License-Identifier: Apache-2.0
#include "hypothesis_bank.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "motion_scale.hpp"
#include "steady_pull.hpp"
#include "track_state.hpp"

namespace sightline::fuse {
namespace {

constexpr size_t kMaxStarts = 8;         // proposed poses that are tried per set and hypothesis
constexpr double kSurpriseAlarm = 16.8;  // 99 % of chi-square with 6 dof
constexpr double kNoSystematic = 1e-14;  // [rad^2, m^2]
constexpr double kSamePose = 4.0;        // squared Mahalanobis distance (6 dof) of one and the same

// Not yet proven poses come after the one in force whatever their evidence.
bool comes_before(const Outcome& a, const Outcome& b) {
  if (a.hypothesis.challenger != b.hypothesis.challenger) return b.hypothesis.challenger;
  return a.hypothesis.evidence < b.hypothesis.evidence;
}

}  // namespace

HypothesisBank::HypothesisBank(const EstimatorOptions& options, ObjectId object,
                               const Lookalikes& lookalikes)
    : options_(options),
      object_(object),
      alike_(lookalikes),
      vote_(options),
      surprise_limit_(chi_square_quantile(options.gate_probability, 6)) {}

BankState HypothesisBank::nothing_known() const {
  BankState state;
  state.published.object = object_;
  return state;
}

void HypothesisBank::step(const BankState& before, Time time, std::span<const Observation> set,
                          BankState& after) {
  after = before;
  after.gated = 0;
  after.iterations = 0;
  after.started = after.reset = false;
  expire(time, after);
  set_ = set;
  collect_voters(time, set, after);
  outcomes_.clear();
  if (!voters_.empty()) {
    const bool was_empty = after.count == 0;
    if (was_empty) {
      start(time, 0.0, false);
    } else {
      for (int i = 0; i < after.count; ++i) {
        follow(after.hypotheses[static_cast<size_t>(i)], time);
      }
      merge_and_sort();
      if (needs_challenger(time, after)) {
        start(time, after.hypotheses[0].evidence, true);
      }
    }
    merge_and_sort();
    settle(after);
    after.started = was_empty && after.count > 0;
  } else {
    for (int i = 0; i < after.count; ++i) {
      Hypothesis& hypothesis = after.hypotheses[static_cast<size_t>(i)];
      hypothesis.estimate = moved_to(time, hypothesis, hypothesis.motion);
    }
  }
  const Outcome* best = outcomes_.empty() ? nullptr : &outcomes_.front();
  const bool contradicted = record_looks(time, set, best, options_, after);
  publish(time, contradicted, options_, alike_, after);
}

void HypothesisBank::expire(Time time, BankState& state) const {
  int kept = 0;
  for (int i = 0; i < state.count; ++i) {
    const Hypothesis old = state.hypotheses[static_cast<size_t>(i)];
    const Duration age = time - old.estimate.last_measured;
    if (age > options_.lost_after) continue;
    state.hypotheses[static_cast<size_t>(kept)] = old;
    // What was learned of the motion does not outlast a gap.
    if (age > options_.max_hold) {
      MotionScale& motion = state.hypotheses[static_cast<size_t>(kept)].motion;
      motion = at_least_nominal(motion);
    }
    ++kept;
  }
  state.count = kept;
  // A challenger that outlives the pose it contradicted has nothing left to challenge.
  if (kept > 0 && state.hypotheses[0].challenger) {
    for (Hypothesis& hypothesis : state.hypotheses) hypothesis.challenger = false;
  }
}

PoseEstimate HypothesisBank::moved_to(Time time, const Hypothesis& hypothesis,
                                      const MotionScale& motion) const {
  PoseEstimate estimate = hypothesis.estimate;
  if (time != estimate.time) estimate = predict(estimate, time, scaled(options_.noise, motion));
  estimate.cameras = 0;
  return estimate;
}

void HypothesisBank::collect_voters(Time time, std::span<const Observation> set,
                                    const BankState& state) {
  voters_.clear();
  CameraSet seeing = 0;
  for (const Observation& observation : set) {
    if (!observation.terms.empty()) seeing |= camera_bit(observation.camera);
  }
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const auto index = static_cast<uint32_t>(std::countr_zero(left));
    const CameraRecord& record = state.cameras[index];
    if (record.seen && time - record.last_look <= hold(record, options_)) {
      seeing |= camera_bit(CameraId(index));
    }
  }
  holding_ = std::popcount(seeing);
  const bool compared = holding_ > 1;
  for (const Observation& observation : set) {
    if (observation.terms.empty()) continue;
    const CameraRecord& record = state.cameras[observation.camera.index() & 63u];
    Voter voter{
        &observation,       std::max(1.0, record.scale), std::max(1.0, record.systematic), 0, 0,
        alike_.blind_axis()};
    if (compared && options_.learn_systematic) {
      voter.unproven_rotation = record.unproven * std::pow(options_.systematic_rotation, 2);
      voter.unproven_translation = record.unproven * std::pow(options_.systematic_translation, 2);
    }
    voters_.push_back(voter);
  }
}

bool HypothesisBank::too_loose(const PoseEstimate& estimate) const {
  return estimate.own_sigma_translation() > options_.reacquire_sigma_translation ||
         estimate.own_sigma_rotation() > options_.reacquire_sigma_rotation;
}

// Poses that look alike are one hypothesis.
bool HypothesisBank::same_pose(const PoseEstimate& a, const PoseEstimate& b) const {
  const Matrix6 covariance = a.own_covariance() + b.own_covariance();
  const Eigen::LDLT<Matrix6> metric(covariance);
  for (size_t k = 0; k < alike_.size(); ++k) {
    const Vector6 d = difference(a.world_from_object, alike_.turned(b.world_from_object, k));
    if (d.dot(metric.solve(d)) < kSamePose) return true;
  }
  return false;
}

// The hypothesis after the set has told which of the poses that look alike it is. They move alike,
// so the choice can be made before the prediction.
Hypothesis HypothesisBank::with_sides(const Hypothesis& hypothesis, Time time) const {
  Hypothesis out = hypothesis;
  const PoseEstimate predicted = moved_to(time, hypothesis, hypothesis.motion);
  alike_.allow_motion(predicted.own_covariance(), out);
  alike_.take(set_, predicted.world_from_object, out);
  alike_.choose(out);
  return out;
}

// Updates one hypothesis with the set.
void HypothesisBank::follow(const Hypothesis& known, Time time) {
  const Hypothesis hypothesis = alike_.size() > 1 ? with_sides(known, time) : known;
  Hypothesis moved = hypothesis;
  moved.estimate = moved_to(time, hypothesis, hypothesis.motion);
  if (too_loose(moved.estimate)) {
    follow_loose(moved, time);
    return;
  }
  vote_.hold(pose_prior(moved.estimate), voters_, moved.estimate.world_from_object, verdict_);
  const MotionScale wanted = wanted_scale(hypothesis.motion);
  if (wanted != hypothesis.motion) {
    // Livelier than it was of late: predict once more with that in mind. If that does not settle
    // it, it was not the motion.
    const PoseEstimate calm = moved.estimate;
    std::swap(verdict_, calm_verdict_);
    moved.motion = wanted;
    moved.estimate = moved_to(time, hypothesis, wanted);
    vote_.hold(pose_prior(moved.estimate), voters_, moved.estimate.world_from_object, verdict_);
    if (verdict_.strained && calm_verdict_.accepted != 0) {
      std::swap(verdict_, calm_verdict_);
      moved.motion = hypothesis.motion;
      moved.estimate = calm;
    } else if (calm_verdict_.accepted == 0 && std::popcount(verdict_.accepted) == 1) {
      moved.confirmations = 0;
    }
  }
  // Cameras that agree with one another, but not with what was believed, do not move it.
  if (verdict_.accepted != 0 && 2.0 * verdict_.minimum.prior_cost > surprise_limit_) {
    verdict_.gated |= std::exchange(verdict_.accepted, 0);
  }
  if (verdict_.accepted == 0) moved.motion = hypothesis.motion;
  add_outcome(moved, time);
}

// A prediction too loose to point at the right minimum tries the poses that the cameras propose as
// well; each minimum found becomes an outcome and has to be confirmed anew.
void HypothesisBank::follow_loose(const Hypothesis& moved, Time time) {
  Hypothesis again = moved;
  again.confirmations = 0;
  const PosePrior prior = pose_prior(moved.estimate);
  bool found = false;
  size_t tried = 0;
  for (const Voter& voter : voters_) {
    for (const PoseHypothesis& proposed : voter.observation->hypotheses) {
      if (++tried > kMaxStarts) break;
      vote_.hold(prior, voters_, proposed.world_from_object, verdict_);
      if (verdict_.accepted == 0) continue;
      add_outcome(again, time);
      found = true;
    }
  }
  vote_.hold(prior, voters_, moved.estimate.world_from_object, verdict_);
  if (!found || verdict_.accepted != 0) add_outcome(again, time);
}

// Motion noise that would have made the set unsurprising; never above the nominal one (or what it
// is already) in one step.
MotionScale HypothesisBank::wanted_scale(const MotionScale& motion) const {
  if (!options_.adapt_motion) return motion;
  if (verdict_.strained) return at_least_nominal(motion);
  if (verdict_.accepted == 0) return motion;
  const Surprises surprises = measure_surprise(verdict_.minimum);
  return surprises.pose.squared > kSurpriseAlarm ? raised(surprises, motion) : motion;
}

// `moved`: the hypothesis at the set's time; verdict_: what the set made of it.
void HypothesisBank::add_outcome(const Hypothesis& moved, Time time) {
  Outcome outcome;
  outcome.hypothesis = moved;
  outcome.hypothesis.evidence += verdict_.evidence;
  outcome.accepted = verdict_.accepted;
  outcome.gated = verdict_.gated;
  outcome.iterations = verdict_.minimum.iterations;
  outcome.normalized_cost = verdict_.normalized_cost;
  outcome.agreement = verdict_.agreement;
  if (verdict_.accepted != 0) {
    Hypothesis& h = outcome.hypothesis;
    h.estimate = posterior(moved.estimate, verdict_.minimum);
    alike_.bound_blind_axis(h.estimate);
    h.estimate.cameras = verdict_.accepted;
    h.estimate.last_measured = time;
    h.confirmations = moved.confirmations + std::popcount(verdict_.accepted);
    if (options_.adapt_motion) {
      double systematic = 1.0;
      for (const Voter& voter : verdict_.accepted_voters) {
        systematic = std::max(systematic, voter.systematic);
      }
      learn(time, verdict_.minimum, holding_, systematic, h.corrections, h.motion);
    }
    add_systematic(h.systematic_information);
    for (size_t i = 0; options_.learn_systematic && i < verdict_.accepted_voters.size(); ++i) {
      const size_t camera = verdict_.accepted_voters[i].observation->camera.index() & 63u;
      outcome.pulls[camera] = pull_of(verdict_.minimum, i);
    }
  }
  outcomes_.push_back(outcome);
}

// A running sum over the cameras that hold the object: each set counts for its own cameras and
// takes the place of their share of the sum.
void HypothesisBank::add_systematic(Matrix6& information) const {
  const double fresh = static_cast<double>(verdict_.accepted_voters.size());
  information *= std::max(0.0, 1.0 - fresh / std::max(1, holding_));
  for (size_t i = 0; i < verdict_.accepted_voters.size(); ++i) {
    // R' = s R + V is what the update took for white; s R + V - R of it is not.
    const Voter& voter = verdict_.accepted_voters[i];
    Matrix6 known = verdict_.minimum.systems[i].information;
    known.diagonal() += anywhere_covariance().diagonal().cwiseInverse();
    Matrix6 part = (1.0 - 1.0 / voter.systematic) * known.ldlt().solve(Matrix6::Identity());
    part.diagonal().head<3>().array() += voter.unproven_rotation / voter.systematic;
    part.diagonal().tail<3>().array() += voter.unproven_translation / voter.systematic;
    part.diagonal().array() += kNoSystematic;
    information += part.ldlt().solve(Matrix6::Identity());
  }
}

void HypothesisBank::start(Time time, double evidence, bool challenger) {
  size_t tried = 0;
  for (const Voter& voter : voters_) {
    for (const PoseHypothesis& proposed : voter.observation->hypotheses) {
      if (++tried > kMaxStarts) return;
      start_from(voter, proposed.world_from_object, time, evidence, challenger);
    }
  }
}

// A start is proposed by one camera; the others of the set join if they agree with it within its
// uncertainty. Then one joint update from "anywhere", so that all are treated alike.
void HypothesisBank::start_from(const Voter& proposer, const Rigid3& pose, Time time,
                                double evidence, bool challenger) {
  Hypothesis fresh;
  fresh.evidence = evidence;
  fresh.challenger = challenger;
  PoseEstimate& prior = fresh.estimate;
  prior.object = object_;
  prior.time = time;
  prior.world_from_object = pose;
  prior.covariance.topLeftCorner<6, 6>() = anywhere_covariance();
  Vector6 sigma;
  sigma << Eigen::Vector3d::Constant(options_.start_sigma_angular),
      Eigen::Vector3d::Constant(options_.start_sigma_linear);
  prior.covariance.bottomRightCorner<6, 6>() = sigma.cwiseAbs2().asDiagonal();

  vote_.hold(pose_prior(prior), std::span(&proposer, 1), pose, verdict_);
  if (verdict_.accepted == 0) return;
  double penalty = 0;
  CameraSet gated = 0;
  if (voters_.size() > 1) {
    const PoseEstimate proposed = posterior(prior, verdict_.minimum);
    others_.clear();
    for (const Voter& voter : voters_) {
      if (voter.observation != proposer.observation) others_.push_back(voter);
    }
    vote_.hold(pose_prior(proposed), others_, proposed.world_from_object, verdict_);
    penalty = verdict_.penalty;
    gated = verdict_.gated;
    const Rigid3 joint =
        verdict_.accepted != 0 ? verdict_.minimum.pose : proposed.world_from_object;
    std::erase_if(others_, [&](const Voter& voter) {
      return (verdict_.accepted & camera_bit(voter.observation->camera)) == 0;
    });
    others_.push_back(proposer);
    vote_.hold(pose_prior(prior), others_, joint, verdict_);
    if (verdict_.accepted == 0) return;
  }
  verdict_.evidence += penalty;
  verdict_.gated |= gated;
  add_outcome(fresh, time);
  Hypothesis& started = outcomes_.back().hypothesis;
  alike_.take(set_, started.estimate.world_from_object, started);
  alike_.choose(started);
}

// Stable, and without the buffer that std::stable_sort allocates.
void HypothesisBank::sort_outcomes() {
  for (size_t i = 1; i < outcomes_.size(); ++i) {
    for (size_t j = i; j > 0 && comes_before(outcomes_[j], outcomes_[j - 1]); --j) {
      std::swap(outcomes_[j], outcomes_[j - 1]);
    }
  }
}

// Best first; of two outcomes at one pose the first stays.
void HypothesisBank::merge_and_sort() {
  sort_outcomes();
  for (size_t i = 0; i < outcomes_.size(); ++i) {
    for (size_t j = outcomes_.size() - 1; j > i; --j) {
      if (!same_pose(outcomes_[i].hypothesis.estimate, outcomes_[j].hypothesis.estimate)) continue;
      outcomes_.erase(outcomes_.begin() + static_cast<ptrdiff_t>(j));
    }
  }
}

// The cameras of this set contradict the hypothesis in force, and no other camera speaks for it.
bool HypothesisBank::needs_challenger(Time time, const BankState& state) const {
  const Outcome& best = outcomes_.front();
  if (best.hypothesis.challenger || best.accepted != 0 || best.gated == 0) return false;
  for (const Outcome& outcome : outcomes_) {
    if (outcome.accepted != 0) return false;  // somebody explains them already
  }
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const auto index = static_cast<uint32_t>(std::countr_zero(left));
    if ((best.gated & camera_bit(CameraId(index))) != 0) continue;  // speaks against it now
    const CameraRecord& record = state.cameras[index];
    if (record.seen && time - record.last_look <= hold(record, options_)) return false;
  }
  return true;
}

// A challenger that was confirmed often enough and explains the measurements better takes over.
bool HypothesisBank::take_over() {
  const double in_force = outcomes_.front().hypothesis.evidence;
  const auto proven = [&](const Outcome& o) {
    return o.hypothesis.challenger && o.hypothesis.confirmations >= options_.reset_sets &&
           o.hypothesis.evidence + options_.drop_margin < in_force;
  };
  if (std::none_of(outcomes_.begin(), outcomes_.end(), proven)) return false;
  std::erase_if(outcomes_, [](const Outcome& o) { return !o.hypothesis.challenger; });
  for (Outcome& outcome : outcomes_) outcome.hypothesis.challenger = false;
  sort_outcomes();
  return true;
}

// The outcomes that remain possible become the bank.
void HypothesisBank::settle(BankState& state) {
  state.count = 0;
  if (outcomes_.empty()) return;
  state.reset = !outcomes_.front().hypothesis.challenger && take_over();
  const double in_force = outcomes_.front().hypothesis.evidence;
  double best = in_force;
  for (const Outcome& outcome : outcomes_) best = std::min(best, outcome.hypothesis.evidence);
  const auto impossible = [&](const Outcome& o) {
    if (!o.hypothesis.challenger) return o.hypothesis.evidence > in_force + options_.drop_margin;
    return o.accepted == 0 || o.hypothesis.evidence > best + options_.drop_margin;
  };
  outcomes_.erase(std::remove_if(outcomes_.begin() + 1, outcomes_.end(), impossible),
                  outcomes_.end());
  const auto kept = std::min(outcomes_.size(), static_cast<size_t>(options_.max_hypotheses));
  const double zero = kept == 1 ? in_force : best;
  for (size_t i = 0; i < kept; ++i) {
    state.hypotheses[i] = outcomes_[i].hypothesis;
    state.hypotheses[i].evidence -= zero;
  }
  state.count = static_cast<int>(kept);
}

}  // namespace sightline::fuse
