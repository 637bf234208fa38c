// SPDX-License-Identifier: Apache-2.0
#include "fuse/update/gating.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "fuse/update/innovation_bias.hpp"

namespace sightline::fuse {
namespace {

// A direction in which the camera knows this much less than the rest (as information) is unknown.
constexpr double kUnknownDirection = 1e-6;
constexpr double kMaxInflation = 1e4;  // of one camera in one set

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
double inflation(const Vector6& distance, const Vector6& camera_variance, int dof) {
  double low = 0, high = std::log(kMaxInflation);
  for (int i = 0; i < 20; ++i) {
    const double middle = 0.5 * (low + high);
    const Vector6 variance = (1.0 + std::exp(middle) * camera_variance.array()).matrix();
    const double squared = distance.cwiseAbs2().cwiseQuotient(variance).sum();
    (squared > dof ? low : high) = middle;
  }
  return std::exp(high);
}

size_t slot(const CameraMeasurement& measurement) {
  return camera_slot(measurement.observation->camera);
}

}  // namespace

Matrix6 anywhere_covariance() {
  Vector6 sigma;
  sigma << Eigen::Vector3d::Constant(kAnywhereRotation),
      Eigen::Vector3d::Constant(kAnywhereTranslation);
  return sigma.cwiseAbs2().asDiagonal();
}

Gating::Gating(const EstimatorOptions& options)
    : min_quality_(options.min_quality),
      max_normalized_cost_(options.max_normalized_cost),
      systematic_covariance_(systematic_covariance(options)),
      gate_(options.gate_probability),
      minimizer_(options.max_iterations) {}

// Cost of the camera's own minimum next to `pose`. Where the camera names the pose of that minimum,
// its cost is exact; the quadratic is not when robust weights are at work.
double Gating::own_cost(const CameraMeasurement& measurement, const CameraSystem& system,
                        const Rigid3& pose) const {
  const Rigid3 own = pose * Rigid3::exp(system.step_to_minimum);
  double cost = system.own_cost;
  for (const PoseHypothesis& h : measurement.observation->hypotheses) {
    if (is_near(own, h.world_from_object)) cost = std::min(cost, h.cost / measurement.scale);
  }
  return cost;
}

// By how much (-2 log likelihood) the camera's best own pose explains its image better, if that
// is not the minimum next to `pose` (flip). Minus infinity if there is none.
double Gating::other_minimum_gain(const CameraMeasurement& measurement, const CameraSystem& system,
                                  const Rigid3& pose) const {
  const PoseHypothesis* best = nullptr;
  for (const PoseHypothesis& h : measurement.observation->hypotheses) {
    if (best == nullptr || h.cost < best->cost) best = &h;
  }
  constexpr double kNowhere = -std::numeric_limits<double>::infinity();
  if (best == nullptr) return kNowhere;
  const Rigid3 own = pose * Rigid3::exp(system.step_to_minimum);
  if (is_near(own, best->world_from_object)) return kNowhere;
  return 2.0 * (system.likelihood_cost() - best->cost / measurement.scale);
}

// With g, H of the camera and P the covariance of everything else, all at the joint minimum, the
// camera's own minimum lies at -H^+ g and the others' at P g; their distance P g + H^+ g has the
// covariance P + H^+, so the squared Mahalanobis distance is g^T (P + H^+) g. Coordinates here: P
// is the identity, H diagonal.
Gating::Innovation Gating::innovation(const Matrix6& rest_information,
                                      const CameraMeasurement& measurement,
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
  const double better = other_minimum_gain(measurement, system, pose);
  result.nis = along.squaredNorm() + std::max(result.agreement.squared, better);
  const double limit = gate_.at(std::max(1, result.dof));
  if (better > limit ||
      2.0 * own_cost(measurement, system, pose) > max_normalized_cost_ * system.residuals) {
    return result;
  }
  if (result.nis <= limit) {
    result.fit = Fit::kConsistent;
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
  result.fit = Fit::kBiased;
  result.inflation = inflation(distance, camera_variance, result.dof);
  return result;
}

Gating::Innovation Gating::innovation_in(const PoseMinimum& minimum, size_t index,
                                         std::span<const CameraMeasurement> measurements) const {
  Matrix6 rest = minimum.prior_information;
  for (size_t i = 0; i < minimum.systems.size(); ++i) {
    if (i != index) rest += minimum.systems[i].information;
  }
  return innovation(rest, measurements[index], minimum.systems[index], minimum.pose);
}

// The poorest fit of all; `innovations` has them one by one.
Gating::Fit Gating::test_jointly(const PoseMinimum& minimum,
                                 std::span<const CameraMeasurement> measurements,
                                 std::vector<Innovation>& innovations) const {
  innovations.clear();
  Fit poorest = Fit::kConsistent;
  for (size_t i = 0; i < measurements.size(); ++i) {
    innovations.push_back(innovation_in(minimum, i, measurements));
    poorest = std::max(poorest, innovations.back().fit);
  }
  return poorest;
}

// Takes the innovations of the accepted measurements for what their cameras are like, and gives
// those that are off less weight.
void Gating::inflate(std::span<const Innovation> innovations, GatedUpdate& result) const {
  for (size_t i = 0; i < innovations.size(); ++i) {
    CameraMeasurement& measurement = result.accepted_measurements[i];
    result.agreement[slot(measurement)] = innovations[i].agreement;
    measurement.systematic *= innovations[i].inflation;
    result.inconsistent |= innovations[i].inflation > 1.0;
  }
}

// -2 log probability of a camera's measurement if its object could be anywhere.
double Gating::outlier_evidence(const CameraMeasurement& measurement,
                                const CameraSystem& alone) const {
  const double best = best_own_cost(*measurement.observation) / measurement.scale;
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

void Gating::refuse(const CameraMeasurement& measurement, const CameraSystem& alone,
                    GatedUpdate& result) const {
  // Not seeing anything at this pose is silence, unless the camera says where it sees it.
  if (alone.usable(min_quality_) || !measurement.observation->hypotheses.empty()) {
    result.gated |= camera_bit(measurement.observation->camera);
  }
  result.penalty += outlier_evidence(measurement, alone);
}

// `accepted_alone`: the systems of those that pass, each at its own minimum with the prior.
void Gating::gate_individually(const PosePrior& prior,
                               std::span<const CameraMeasurement> measurements, const Rigid3& start,
                               GatedUpdate& result, std::vector<CameraSystem>& accepted_alone) {
  result.accepted_measurements.clear();
  accepted_alone.clear();
  for (const CameraMeasurement& measurement : measurements) {
    minimizer_.run(prior, std::span(&measurement, 1), start, minimum_alone_);
    const Innovation test = innovation_in(minimum_alone_, 0, std::span(&measurement, 1));
    if (test.fit == Fit::kOutlier) {
      refuse(measurement, minimum_alone_.systems[0], result);
      continue;
    }
    result.accepted_measurements.push_back(measurement);
    result.accepted_measurements.back().systematic *= test.inflation;
    accepted_alone.push_back(minimum_alone_.systems[0]);
  }
}

// The one that is the farthest beyond its gate.
size_t Gating::worst_outlier(std::span<const Innovation> innovations) const {
  size_t worst = 0;
  double worst_ratio = -1;
  for (size_t i = 0; i < innovations.size(); ++i) {
    const Innovation& test = innovations[i];
    if (test.fit != Fit::kOutlier) continue;
    const double ratio = test.usable ? test.nis / gate_.at(std::max(1, test.dof)) : 1e9;
    if (ratio <= worst_ratio) continue;
    worst = i;
    worst_ratio = ratio;
  }
  return worst;
}

void Gating::remove_outliers(const PosePrior& prior, const Rigid3& start, GatedUpdate& result,
                             std::vector<CameraSystem>& accepted_alone) {
  std::vector<CameraMeasurement>& measurements = result.accepted_measurements;
  while (!measurements.empty()) {
    minimizer_.run(prior, measurements, start, result.minimum);
    const Fit poorest = test_jointly(result.minimum, measurements, innovations_);
    if (poorest != Fit::kOutlier || (measurements.size() == 1 && innovations_[0].usable)) {
      inflate(innovations_, result);  // one alone has passed already
      if (poorest == Fit::kBiased) minimizer_.run(prior, measurements, start, result.minimum);
      return;
    }
    const size_t worst = worst_outlier(innovations_);
    if (measurements.size() == 2 && innovations_[worst].usable) {
      // Nobody can decide between two: both count, with the uncertainty that their difference
      // shows.
      const Innovation& test = innovations_[worst];
      const double factor = std::max(1.0, test.nis / std::max(1, test.dof));
      for (CameraMeasurement& measurement : measurements) measurement.scale *= factor;
      minimizer_.run(prior, measurements, start, result.minimum);
      return;
    }
    refuse(measurements[worst], accepted_alone[worst], result);
    measurements.erase(measurements.begin() + static_cast<ptrdiff_t>(worst));
    accepted_alone.erase(accepted_alone.begin() + static_cast<ptrdiff_t>(worst));
  }
}

// Evidence, then honest covariance: a camera whose residuals are larger than it claims is scaled.
void Gating::finish(const PosePrior& prior, GatedUpdate& result) {
  result.evidence = result.penalty;
  if (result.accepted_measurements.empty()) return;
  PoseMinimum& minimum = result.minimum;
  result.evidence += 2.0 * minimum.prior_cost + log_det(minimum.information()) -
                     log_det(minimum.prior_information);
  bool rescaled = false;
  for (size_t i = 0; i < result.accepted_measurements.size(); ++i) {
    CameraMeasurement& measurement = result.accepted_measurements[i];
    const CameraSystem& system = minimum.systems[i];
    result.accepted |= camera_bit(measurement.observation->camera);
    const double squares = 2.0 * (own_cost(measurement, system, minimum.pose) + system.pose_cost);
    result.evidence += squares;
    result.normalized_cost[slot(measurement)] = squares * measurement.scale / system.residuals;
    if (squares <= gate_.at(system.residuals)) continue;
    measurement.scale *= squares / system.residuals;
    rescaled = true;
  }
  if (!rescaled) return;
  const Rigid3 start = minimum.pose;
  const int before = minimum.iterations;
  minimizer_.run(prior, result.accepted_measurements, start, minimum);
  minimum.iterations += before;
}

void Gating::run(const PosePrior& prior, std::span<const CameraMeasurement> measurements,
                 const Rigid3& start, GatedUpdate& result) {
  result.accepted = result.gated = 0;
  result.evidence = result.penalty = 0;
  result.inconsistent = false;
  result.agreement.fill({});
  result.accepted_measurements.assign(measurements.begin(), measurements.end());
  minimizer_.run(prior, measurements, start, result.minimum);
  const Fit poorest = test_jointly(result.minimum, measurements, innovations_);
  if (poorest != Fit::kOutlier) {
    inflate(innovations_, result);
    if (poorest == Fit::kBiased) {
      const Rigid3 near = result.minimum.pose;
      minimizer_.run(prior, result.accepted_measurements, near, result.minimum);
    }
  } else if (measurements.size() == 1) {
    refuse(measurements[0], result.minimum.systems[0], result);
    result.accepted_measurements.clear();
  } else {
    gate_individually(prior, measurements, start, result, accepted_alone_);
    remove_outliers(prior, start, result, accepted_alone_);
  }
  result.inconsistent |= poorest == Fit::kOutlier;
  finish(prior, result);
}

}  // namespace sightline::fuse
