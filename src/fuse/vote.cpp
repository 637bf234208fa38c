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

double log_det(const Matrix6& m) {
  return 2.0 * m.llt().matrixLLT().diagonal().array().abs().max(1e-300).log().sum();
}

// Cost of the best pose that the camera proposes by itself; infinite if it proposes none.
double best_own_cost(const Observation& observation) {
  double best = std::numeric_limits<double>::infinity();
  for (const PoseHypothesis& h : observation.hypotheses) best = std::min(best, h.cost);
  return best;
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
      minimizer_(options.max_iterations) {}

// With g, H of the camera and P the covariance of everything else, all at the joint minimum, the
// camera's own minimum lies at -H^+ g and the others' at P g; their distance P g + H^+ g has the
// covariance P + H^+, so the squared Mahalanobis distance is g^T (P + H^+) g. The share g^T H^+ g
// is what the camera's cost would drop to its own minimum; where the camera knows a better minimum
// elsewhere (flip), the real drop is taken.
Vote::Innovation Vote::innovation(const Matrix6& rest_information, const Voter& voter,
                                  const CameraSystem& system) const {
  Innovation result;
  result.usable = system.usable(min_quality_);
  if (!result.usable) return result;
  const Eigen::LLT<Matrix6> rest(rest_information);  // information = L L^T, P = L^-T L^-1
  Matrix6 relative = rest.matrixL().solve(system.information);
  relative = rest.matrixL().solve(relative.transpose()).eval();
  const Vector6 gradient = rest.matrixL().solve(system.gradient);
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(relative);
  const Vector6 along = eigen.eigenvectors().transpose() * gradient;
  double own_drop = 0;
  for (int i = 0; i < 6; ++i) {
    if (eigen.eigenvalues()[i] < kUnknownDirection) continue;
    ++result.dof;
    own_drop += along[i] * along[i] / eigen.eigenvalues()[i];
  }
  const double elsewhere = 2.0 * (system.cost - best_own_cost(*voter.observation) / voter.scale);
  result.nis = gradient.squaredNorm() + std::max(own_drop, elsewhere);
  result.fits = result.nis <= gate_.at(std::max(1, result.dof)) &&
                2.0 * system.cost <= max_normalized_cost_ * system.residuals;
  return result;
}

Vote::Innovation Vote::innovation_in(const PoseMinimum& minimum, size_t index,
                                     std::span<const Voter> voters) const {
  Matrix6 rest = minimum.prior_information;
  for (size_t i = 0; i < minimum.systems.size(); ++i) {
    if (i != index) rest += minimum.systems[i].information;
  }
  return innovation(rest, voters[index], minimum.systems[index]);
}

bool Vote::all_fit(const PoseMinimum& minimum, std::span<const Voter> voters) const {
  for (size_t i = 0; i < voters.size(); ++i) {
    if (!innovation_in(minimum, i, voters).fits) return false;
  }
  return true;
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
  return 2.0 * std::min(std::max(0.0, alone.cost - drop), best) + log_det(relative);
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
    if (innovation_in(alone_, 0, std::span(&voter, 1)).fits) {
      verdict.accepted_voters.push_back(voter);
      alone_systems_.push_back(alone_.systems[0]);
    } else {
      refuse(voter, alone_.systems[0], verdict);
    }
  }
}

void Vote::agree_among_themselves(const PosePrior& prior, const Rigid3& start, Verdict& verdict) {
  std::vector<Voter>& voters = verdict.accepted_voters;
  while (!voters.empty()) {
    minimizer_.run(prior, voters, start, verdict.minimum);
    size_t worst = 0;
    double worst_ratio = 0;
    int worst_dof = 6;
    for (size_t i = 0; i < voters.size(); ++i) {
      const Innovation test = innovation_in(verdict.minimum, i, voters);
      const double ratio = test.usable ? test.nis / gate_.at(std::max(1, test.dof)) : 1e9;
      if (ratio <= worst_ratio) continue;
      worst = i;
      worst_ratio = ratio;
      worst_dof = std::max(1, test.dof);
    }
    if (worst_ratio <= 1.0) return;
    if (voters.size() == 2 && worst_ratio < 1e9) {
      // Two witnesses, nobody to decide: both count, with the uncertainty their quarrel shows.
      for (Voter& voter : voters) voter.scale *= worst_ratio * gate_.at(worst_dof) / worst_dof;
      minimizer_.run(prior, voters, start, verdict.minimum);
      return;
    }
    if (voters.size() == 1 && worst_ratio < 1e9) return;  // passed alone already
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
  verdict.evidence +=
      2.0 * minimum.cost + log_det(minimum.information()) - log_det(minimum.prior_information);
  bool rescaled = false;
  for (size_t i = 0; i < verdict.accepted_voters.size(); ++i) {
    Voter& voter = verdict.accepted_voters[i];
    const CameraSystem& system = minimum.systems[i];
    verdict.accepted |= camera_bit(voter.observation->camera);
    verdict.normalized_cost[slot(voter)] = 2.0 * system.cost * voter.scale / system.residuals;
    if (2.0 * system.cost <= gate_.at(system.residuals)) continue;
    voter.scale *= 2.0 * system.cost / system.residuals;
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
  verdict.accepted_voters.assign(voters.begin(), voters.end());
  minimizer_.run(prior, voters, start, verdict.minimum);
  if (!all_fit(verdict.minimum, voters)) {
    if (voters.size() == 1) {
      refuse(voters[0], verdict.minimum.systems[0], verdict);
      verdict.accepted_voters.clear();
    } else {
      test_alone(prior, voters, start, verdict);
      agree_among_themselves(prior, start, verdict);
    }
  }
  sum_up(prior, verdict);
}

}  // namespace sightline::fuse
