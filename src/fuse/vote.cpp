// SPDX-License-Identifier: Apache-2.0
#include "vote.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace sightline::fuse {
namespace {

// A direction in which the camera knows this much less than the rest (as information) is unknown.
constexpr double kUnknownDirection = 1e-6;
constexpr double kMaxWidening = 1e4;  // of one camera in one set

double log_det(const Matrix6& m) {
  return 2.0 * m.llt().matrixLLT().diagonal().array().abs().max(1e-300).log().sum();
}

// Cost of the best pose that the camera proposes by itself; infinite if it proposes none.
double best_own_cost(const Observation& observation) {
  double best = std::numeric_limits<double>::infinity();
  for (const PoseHypothesis& h : observation.hypotheses) best = std::min(best, h.cost);
  return best;
}

constexpr double kSameMinimumRotation = 0.1;      // [rad] two minima this close are one and the
constexpr double kSameMinimumTranslation = 0.05;  // [m] same

bool is_near(const Rigid3& a, const Rigid3& b) {
  return rotation_angle(a, b) < kSameMinimumRotation &&
         translation_distance(a, b) < kSameMinimumTranslation;
}

// The factor of the camera's variance that makes the squared distance from the rest what it should
// be, dof. Coordinates: the rest has variance 1.
double widening(const Vector6& distance, const Vector6& camera_variance, int dof) {
  double low = 0, high = std::log(kMaxWidening);
  for (int i = 0; i < 20; ++i) {
    const double middle = 0.5 * (low + high);
    const Vector6 variance = (1.0 + std::exp(middle) * camera_variance.array()).matrix();
    const double squared = distance.cwiseAbs2().cwiseQuotient(variance).sum();
    (squared > dof ? low : high) = middle;
  }
  return std::exp(high);
}

size_t slot(const Voter& voter) { return voter.observation->camera.index() & 63u; }

}  // namespace

Matrix6 anywhere_covariance() {
  Vector6 sigma;
  sigma << Eigen::Vector3d::Constant(kAnywhereRotation),
      Eigen::Vector3d::Constant(kAnywhereTranslation);
  return sigma.cwiseAbs2().asDiagonal();
}

Vote::Vote(const EstimatorOptions& options)
    : min_quality_(options.min_quality),
      max_normalized_cost_(options.max_normalized_cost),
      gate_(options.gate_probability),
      minimizer_(options.max_iterations) {
  Vector6 sigma;
  sigma << Eigen::Vector3d::Constant(options.systematic_rotation),
      Eigen::Vector3d::Constant(options.systematic_translation);
  systematic_covariance_ = sigma.cwiseAbs2().asDiagonal();
}

// Cost of the camera's own minimum next to `pose`. Where the camera names the pose of that minimum,
// its cost is exact; the quadratic is not when robust weights are at work.
double Vote::own_cost(const Voter& voter, const CameraSystem& system, const Rigid3& pose) const {
  const Rigid3 own = pose * Rigid3::exp(system.to_own_minimum);
  double cost = system.own_cost;
  for (const PoseHypothesis& h : voter.observation->hypotheses) {
    if (is_near(own, h.world_from_object)) cost = std::min(cost, h.cost / voter.scale);
  }
  return cost;
}

// By how much (-2 log likelihood) the camera's best own pose explains its picture better, if that
// is not the minimum next to `pose` (flip). Minus infinity if there is none.
double Vote::elsewhere(const Voter& voter, const CameraSystem& system, const Rigid3& pose) const {
  const PoseHypothesis* best = nullptr;
  for (const PoseHypothesis& h : voter.observation->hypotheses) {
    if (best == nullptr || h.cost < best->cost) best = &h;
  }
  constexpr double kNowhere = -std::numeric_limits<double>::infinity();
  if (best == nullptr) return kNowhere;
  const Rigid3 own = pose * Rigid3::exp(system.to_own_minimum);
  if (is_near(own, best->world_from_object)) return kNowhere;
  return 2.0 * (system.likelihood_cost() - best->cost / voter.scale);
}

// With g, H of the camera and P the covariance of everything else, all at the joint minimum, the
// camera's own minimum lies at -H^+ g and the others' at P g; their distance P g + H^+ g has the
// covariance P + H^+, so the squared Mahalanobis distance is g^T (P + H^+) g. Coordinates here: P
// is the identity, H diagonal.
Vote::Innovation Vote::innovation(const Matrix6& rest_information, const Voter& voter,
                                  const CameraSystem& system, const Rigid3& pose) const {
  Innovation result;
  if (!system.usable(min_quality_)) return result;
  result.usable = true;
  const Eigen::LLT<Matrix6> rest(rest_information);  // information = L L^T, P = L^-T L^-1
  Matrix6 relative = rest.matrixL().solve(system.information);
  relative = rest.matrixL().solve(relative.transpose()).eval();
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(relative);
  const Vector6 along =
      eigen.eigenvectors().transpose() * rest.matrixL().solve(system.gradient).eval();
  Vector6 distance = Vector6::Zero();
  Vector6 camera_variance;
  for (int i = 0; i < 6; ++i) {
    const double known = eigen.eigenvalues()[i];
    camera_variance[i] = 1.0 / std::max(known, kUnknownDirection);
    if (known < kUnknownDirection) continue;
    ++result.dof;
    distance[i] = along[i] * (1.0 + 1.0 / known);
    result.agreement.squared += along[i] * along[i] / known;
    result.agreement.expected += 1.0 / (1.0 + known);
  }
  const double better = elsewhere(voter, system, pose);
  result.nis = along.squaredNorm() + std::max(result.agreement.squared, better);
  const double limit = gate_.at(std::max(1, result.dof));
  if (better > limit ||
      2.0 * own_cost(voter, system, pose) > max_normalized_cost_ * system.residuals) {
    return result;
  }
  if (result.nis <= limit) {
    result.fit = Fit::kFits;
    return result;
  }
  // Would the largest systematic error that is believed explain it?
  const Matrix6 axes = rest.matrixU().solve(eigen.eigenvectors());
  Vector6 variance = camera_variance;
  variance.array() += 1.0;
  const Matrix6 covariance =
      systematic_covariance_ + axes * variance.asDiagonal() * axes.transpose();
  const Vector6 off = axes * distance;
  if (off.dot(covariance.ldlt().solve(off)) > limit) return result;
  result.fit = Fit::kOff;
  result.widening = widening(distance, camera_variance, result.dof);
  return result;
}

Vote::Innovation Vote::innovation_in(const PoseMinimum& minimum, size_t index,
                                     std::span<const Voter> voters) const {
  Matrix6 rest = minimum.prior_information;
  for (size_t i = 0; i < minimum.systems.size(); ++i) {
    if (i != index) rest += minimum.systems[i].information;
  }
  return innovation(rest, voters[index], minimum.systems[index], minimum.pose);
}

// The poorest fit of all; innovations_ has them one by one.
Vote::Fit Vote::test_all(const PoseMinimum& minimum, std::span<const Voter> voters) {
  innovations_.clear();
  Fit poorest = Fit::kFits;
  for (size_t i = 0; i < voters.size(); ++i) {
    innovations_.push_back(innovation_in(minimum, i, voters));
    poorest = std::max(poorest, innovations_.back().fit);
  }
  return poorest;
}

// Takes the last test for what the cameras are like, and lets those that are off count less.
void Vote::widen(Verdict& verdict) const {
  for (size_t i = 0; i < innovations_.size(); ++i) {
    Voter& voter = verdict.accepted_voters[i];
    verdict.agreement[slot(voter)] = innovations_[i].agreement;
    voter.systematic *= innovations_[i].widening;
    verdict.strained |= innovations_[i].widening > 1.0;
  }
}

// -2 log probability of a camera's measurement if its object could be anywhere.
double Vote::unexplained(const Voter& voter, const CameraSystem& alone) const {
  const double best = best_own_cost(*voter.observation) / voter.scale;
  if (!alone.usable(min_quality_)) {
    // No curvature known here: as if it located the object to 0.1 deg and 1 mm.
    const double spread =
        6.0 * std::log(kAnywhereRotation / 0.0017) + 6.0 * std::log(kAnywhereTranslation / 0.001);
    return spread + (std::isfinite(best) ? 2.0 * best : 0.0);
  }
  const Matrix6 anywhere = anywhere_covariance();
  const Vector6 sigma = anywhere.diagonal().cwiseSqrt();
  const Matrix6 relative =
      Matrix6::Identity() + sigma.asDiagonal() * alone.information * sigma.asDiagonal();
  const Eigen::LDLT<Matrix6> solver(
      Matrix6(alone.information + 1e-9 * Matrix6(alone.information.diagonal().asDiagonal()) +
              Matrix6(anywhere.diagonal().cwiseInverse().asDiagonal())));
  const double drop = 0.5 * alone.gradient.dot(solver.solve(alone.gradient));
  return 2.0 * std::min(std::max(0.0, alone.likelihood_cost() - drop), best) + log_det(relative);
}

void Vote::refuse(const Voter& voter, const CameraSystem& alone, Verdict& verdict) const {
  // Not seeing anything at this pose is silence, unless the camera says where it sees it.
  if (alone.usable(min_quality_) || !voter.observation->hypotheses.empty()) {
    verdict.gated |= camera_bit(voter.observation->camera);
  }
  verdict.penalty += unexplained(voter, alone);
}

void Vote::test_alone(const PosePrior& prior, std::span<const Voter> voters, const Rigid3& start,
                      Verdict& verdict) {
  verdict.accepted_voters.clear();
  alone_systems_.clear();
  for (const Voter& voter : voters) {
    minimizer_.run(prior, std::span(&voter, 1), start, alone_);
    const Innovation test = innovation_in(alone_, 0, std::span(&voter, 1));
    if (test.fit == Fit::kContradicts) {
      refuse(voter, alone_.systems[0], verdict);
      continue;
    }
    verdict.accepted_voters.push_back(voter);
    verdict.accepted_voters.back().systematic *= test.widening;
    alone_systems_.push_back(alone_.systems[0]);
  }
}

void Vote::agree_among_themselves(const PosePrior& prior, const Rigid3& start, Verdict& verdict) {
  std::vector<Voter>& voters = verdict.accepted_voters;
  while (!voters.empty()) {
    minimizer_.run(prior, voters, start, verdict.minimum);
    const Fit poorest = test_all(verdict.minimum, voters);
    if (poorest != Fit::kContradicts || (voters.size() == 1 && innovations_[0].usable)) {
      widen(verdict);  // one alone has passed already
      if (poorest == Fit::kOff) minimizer_.run(prior, voters, start, verdict.minimum);
      return;
    }
    size_t worst = 0;
    double worst_ratio = -1;
    for (size_t i = 0; i < voters.size(); ++i) {
      const Innovation& test = innovations_[i];
      if (test.fit != Fit::kContradicts) continue;
      const double ratio = test.usable ? test.nis / gate_.at(std::max(1, test.dof)) : 1e9;
      if (ratio <= worst_ratio) continue;
      worst = i;
      worst_ratio = ratio;
    }
    if (voters.size() == 2 && innovations_[worst].usable) {
      // Two witnesses, nobody to decide: both count, with the uncertainty their quarrel shows.
      const Innovation& test = innovations_[worst];
      const double factor = std::max(1.0, test.nis / std::max(1, test.dof));
      for (Voter& voter : voters) voter.scale *= factor;
      minimizer_.run(prior, voters, start, verdict.minimum);
      return;
    }
    refuse(voters[worst], alone_systems_[worst], verdict);
    voters.erase(voters.begin() + static_cast<ptrdiff_t>(worst));
    alone_systems_.erase(alone_systems_.begin() + static_cast<ptrdiff_t>(worst));
  }
}

// Evidence, then honest covariance: a camera whose residuals are larger than it claims is scaled.
void Vote::sum_up(const PosePrior& prior, Verdict& verdict) {
  verdict.evidence = verdict.penalty;
  if (verdict.accepted_voters.empty()) return;
  PoseMinimum& minimum = verdict.minimum;
  verdict.evidence += 2.0 * minimum.prior_cost + log_det(minimum.information()) -
                      log_det(minimum.prior_information);
  bool rescaled = false;
  for (size_t i = 0; i < verdict.accepted_voters.size(); ++i) {
    Voter& voter = verdict.accepted_voters[i];
    const CameraSystem& system = minimum.systems[i];
    verdict.accepted |= camera_bit(voter.observation->camera);
    const double squares = 2.0 * (own_cost(voter, system, minimum.pose) + system.pose_cost);
    verdict.evidence += squares;
    verdict.normalized_cost[slot(voter)] = squares * voter.scale / system.residuals;
    if (squares <= gate_.at(system.residuals)) continue;
    voter.scale *= squares / system.residuals;
    rescaled = true;
  }
  if (!rescaled) return;
  const Rigid3 start = minimum.pose;
  const int before = minimum.iterations;
  minimizer_.run(prior, verdict.accepted_voters, start, minimum);
  minimum.iterations += before;
}

void Vote::hold(const PosePrior& prior, std::span<const Voter> voters, const Rigid3& start,
                Verdict& verdict) {
  verdict.accepted = verdict.gated = 0;
  verdict.evidence = verdict.penalty = 0;
  verdict.strained = false;
  verdict.agreement.fill({});
  verdict.accepted_voters.assign(voters.begin(), voters.end());
  minimizer_.run(prior, voters, start, verdict.minimum);
  const Fit poorest = test_all(verdict.minimum, voters);
  if (poorest != Fit::kContradicts) {
    widen(verdict);
    if (poorest == Fit::kOff) {
      const Rigid3 near = verdict.minimum.pose;
      minimizer_.run(prior, verdict.accepted_voters, near, verdict.minimum);
    }
  } else if (voters.size() == 1) {
    refuse(voters[0], verdict.minimum.systems[0], verdict);
    verdict.accepted_voters.clear();
  } else {
    test_alone(prior, voters, start, verdict);
    agree_among_themselves(prior, start, verdict);
  }
  verdict.strained |= poorest == Fit::kContradicts;
  sum_up(prior, verdict);
}

}  // namespace sightline::fuse
