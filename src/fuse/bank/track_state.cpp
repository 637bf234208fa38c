// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/track_state.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>

#include "fuse/bank/camera_record.hpp"
#include "fuse/update/gating.hpp"
#include "fuse/update/innovation_bias.hpp"
#include "fuse/update/motion_scale.hpp"

namespace sightline::fuse {
namespace {

constexpr Duration kSettle = std::chrono::milliseconds(100);

double largest_sigma(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

// What is against `tracking`, of an object that `holding` cameras see.
DegradedReasons degraded_reasons_of(int holding, const EstimatorOptions& options,
                                    const SymmetricHypotheses& symmetric, const BankState& state,
                                    bool contradicted) {
  const Hypothesis& main = state.hypotheses[0];
  const Matrix6 covariance = state.published.own_covariance();
  const bool alone = holding == 1;
  const double limit =
      alone ? std::min(options.max_sigma_translation, options.max_sigma_translation_alone)
            : options.max_sigma_translation;
  const double rotation_limit =
      alone && state.outline_only
          ? std::min(options.max_sigma_rotation, options.max_sigma_rotation_alone)
          : options.max_sigma_rotation;
  DegradedReasons degraded_reasons = 0;
  const auto add = [&](bool holds, DegradedReason reason) {
    if (holds) degraded_reasons = static_cast<DegradedReasons>(degraded_reasons | reason);
  };
  add(main.confirmations < options.confirm_sets, kUnconfirmed);
  add(state.count > 1, kSeveralPoses);
  add(symmetric.ambiguous(main), kAmbiguous);
  add(state.published.own_sigma_translation() > limit, kWeakPosition);
  add(largest_sigma(symmetric.known_rotation(covariance.topLeftCorner<3, 3>())) > rotation_limit,
      kWeakRotation);
  add(alone && (options.one_camera_is_degraded || (degraded_reasons & kWeakPosition) != 0),
      kOneCamera);
  add(alone && state.flat_print && !state.solid && options.flat_print_is_degraded, kFlatPrint);
  add(state.unexplained || state.absent, kUnexplained);
  add(contradicted, kContradicted);
  return degraded_reasons;
}

// An outline on its way to the right edges passes every test now and then. So nothing in the
// estimate must have spoken against `tracking` for kSettle, or for as long as it did before: time
// without doubt adds up, time with doubt is taken off. What others say against it counts while they
// say it. Markers and textures say at once where they are.
bool settled(Time time, bool sure, BankState& state) {
  const Duration passed = std::clamp(time - state.judged, Duration(0), kSettle);
  state.judged = time;
  state.undoubted = sure ? std::min(kSettle, state.undoubted + passed)
                         : std::max(Duration(0), state.undoubted - passed);
  return sure && (!state.outline_only || state.undoubted == kSettle);
}

void classify(Time time, const Objections& objections, const EstimatorOptions& options,
              const SymmetricHypotheses& symmetric, BankState& state) {
  PoseEstimate& out = state.published;
  out.degraded_reasons = 0;
  if (state.count == 0) {
    const bool long_ago = time - out.last_measured > options.searching_after;
    out.state = state.found_before && !long_ago ? TrackState::kLost : TrackState::kSearching;
    settled(time, false, state);
    return;
  }
  const int holding = std::popcount(holding_cameras(time, options, state));
  if (holding == 0) {
    out.state = TrackState::kCoasting;
    settled(time, false, state);
    const int reasons = (objections.outside & kPossibleSwap) |
                        (symmetric.ambiguous(state.hypotheses[0]) ? kAmbiguous : 0);
    out.degraded_reasons = static_cast<DegradedReasons>(reasons);
    return;
  }
  // Of as many cameras that say one thing as say another nobody knows which are right.
  const bool contradicted =
      objections.contradicted || refused_cameras(time, options, state) >= holding;
  const DegradedReasons inside =
      degraded_reasons_of(holding, options, symmetric, state, contradicted);
  // Nobody has tracked yet what was found and is doubted.
  const bool untried = state.detected && objections.outside != 0;
  const bool sure = settled(time, inside == 0 && !untried, state);
  const int doubts = inside == 0 && !sure ? kUnconfirmed : 0;
  out.degraded_reasons = static_cast<DegradedReasons>(inside | objections.outside | doubts);
  out.state = out.degraded_reasons == 0 ? TrackState::kTracking : TrackState::kDegraded;
  // Where two cameras see the object no picture is that is larger or smaller.
  state.solid |= out.state == TrackState::kTracking && holding > 1;
}

// The filter takes a camera's systematic error for new in every frame and averages it away. What is
// published is in no direction surer than the systematic error of the cameras that hold the object.
void keep_systematic(const Matrix6& information, const Matrix6& steady, PoseEstimate& estimate) {
  if (information.isZero(0.0) && steady.isZero(0.0)) return;
  Matrix6 min = steady;
  if (!information.isZero(0.0)) {
    const Matrix6 bounded = information + Matrix6(anywhere_covariance().inverse());
    min += bounded.ldlt().solve(Matrix6::Identity());
  }
  const Eigen::LLT<Matrix6> root(estimate.pose_covariance());  // P = L L^T
  Matrix6 relative = root.matrixL().solve(min);
  relative = root.matrixL().solve(relative.transpose()).eval();
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(relative);
  const Vector6 missing = (eigen.eigenvalues().array() - 1.0).cwiseMax(0.0);
  const Matrix6 axes = root.matrixL() * eigen.eigenvectors();
  estimate.covariance.topLeftCorner<6, 6>() += axes * missing.asDiagonal() * axes.transpose();
}

// Moments of the mixture about the pose in force.
void add_spread(const BankState& state, PoseEstimate& estimate) {
  double total = 0;
  for (int i = 0; i < state.count; ++i) {
    total += std::exp(-0.5 * state.hypotheses[static_cast<size_t>(i)].evidence);
  }
  if (!(total > 0)) return;
  for (int i = 1; i < state.count; ++i) {
    const Hypothesis& other = state.hypotheses[static_cast<size_t>(i)];
    const Vector6 d = difference(estimate.world_from_object, other.estimate.world_from_object);
    const double weight = std::exp(-0.5 * other.evidence) / total;
    estimate.covariance.topLeftCorner<6, 6>() += weight * d * d.transpose();
  }
}

}  // namespace

void publish(Time time, const Objections& objections, const EstimatorOptions& options,
             const SymmetricHypotheses& symmetric, BankState& state) {
  PoseEstimate& out = state.published;
  if (state.count > 0) {
    out = state.hypotheses[0].estimate;
    state.found_before = true;
    const CameraSet cameras = holding_cameras(time, options, state);
    const int holding = std::max(1, std::popcount(cameras));
    const Matrix6& systematic = state.hypotheses[0].systematic_information;
    keep_systematic(systematic, Matrix6::Zero(), out);
    // Beside the covariance: observers place their lines by that, next to where the filter is.
    PoseEstimate wide = out;
    Matrix6 steady = state.bias_share / holding * systematic_covariance(options);
    if (std::popcount(cameras) == 1 && state.outline_only) {
      const CameraRecord& alone = state.cameras[static_cast<size_t>(std::countr_zero(cameras))];
      steady += persistent_covariance(alone, out.world_from_object);
    }
    keep_systematic(systematic, steady, wide);
    const Matrix6 added = wide.own_covariance() - out.own_covariance();
    add_spread(state, out);
    out.alternatives = symmetric.spread(state.hypotheses[0]) + added;
  } else {
    out.cameras = 0;
  }
  out.time = time;
  classify(time, objections, options, symmetric, state);
  if (out.state != TrackState::kCoasting) return;
  for (Hypothesis& hypothesis : state.hypotheses) {
    hypothesis.motion = at_least_nominal(hypothesis.motion);
  }
}

TrackState state_in_silence(const BankState& state, Time now, const EstimatorOptions& options) {
  const PoseEstimate& newest = state.published;
  if (!state.found_before) return TrackState::kSearching;
  const Duration age = now - newest.last_measured;
  if (age > options.searching_after) return TrackState::kSearching;
  if (state.count == 0 || age > options.lost_after) return TrackState::kLost;
  if (now > held_until(state, options) + options.silence) return TrackState::kCoasting;
  return newest.state;
}

void append_silence(const BankState& state, Time now, const EstimatorOptions& options,
                    std::vector<PoseEstimate>& track) {
  const PoseEstimate newest = state.published;
  if (!has_pose(newest.state)) return;
  const Duration instant{1};
  const Time lost = newest.last_measured + options.lost_after + instant;
  const Time coasting = held_until(state, options) + options.silence + instant;
  if (newest.state != TrackState::kCoasting && coasting > newest.time && coasting < lost &&
      now >= coasting) {
    track.push_back(predict(newest, coasting, options.noise));
    track.back().state = TrackState::kCoasting;
    track.back().cameras = 0;
  }
  if (now < lost || lost <= newest.time) return;
  track.push_back(newest);
  track.back().time = lost;
  track.back().state = TrackState::kLost;
  track.back().cameras = 0;
}

}  // namespace sightline::fuse
