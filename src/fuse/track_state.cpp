// SPDX-License-Identifier: Apache-2.0
#include "track_state.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>

#include "motion_scale.hpp"
#include "steady_pull.hpp"
#include "vote.hpp"

namespace sightline::fuse {
namespace {

constexpr double kPeriodSmoothing = 0.2;
constexpr double kScaleSmoothing = 0.1;
constexpr double kSystematicGain = 0.2;  // of the logarithm, per frame that agrees perfectly
constexpr double kProofGain = 1.0;       // the same of the unproven share
constexpr double kLeastUnproven = 1e-5;
constexpr double kSystematicJump = 0.7;  // of the logarithm, at most per frame
constexpr double kSharedBlame = 0.15;    // of the logarithm, per frame
constexpr double kMaxSystematic = 1000;
// Chance must not look like a systematic error: more than this share above expectation, and the
// memory of better agreement has to be used up first.
constexpr double kSystematicMargin = 1.25;
constexpr double kMinSystematic = 0.4;

size_t slot(CameraId camera) { return camera.index() & 63u; }

void update_period(Time time, CameraRecord& record) {
  const Duration interval = time - record.last_look;
  if (!record.known || interval <= Duration(0)) return;
  if (record.period == Duration(0)) {
    record.period = interval;
    return;
  }
  // A gap is a dropped frame more often than a slower camera.
  const double gain = interval > record.period * 3 / 2 ? 0.25 * kPeriodSmoothing : kPeriodSmoothing;
  record.period += from_seconds(gain * to_seconds(interval - record.period));
}

CameraSet holders(Time time, const EstimatorOptions& options, const BankState& state) {
  CameraSet holding = 0;
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const auto index = static_cast<size_t>(std::countr_zero(left));
    const CameraRecord& record = state.cameras[index];
    if (record.seen && time - record.last_look <= hold(record, options)) {
      holding |= CameraSet{1} << index;
    }
  }
  return holding;
}

int holding_cameras(Time time, const EstimatorOptions& options, const BankState& state) {
  return std::popcount(holders(time, options, state));
}

double largest_sigma(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

// What is against `tracking`, of an object that `holding` cameras see.
Doubts doubts_of(int holding, bool contradicted, const EstimatorOptions& options,
                 const AlikePoses& alike, const BankState& state) {
  const Hypothesis& main = state.hypotheses[0];
  const Matrix6 covariance = state.published.own_covariance();
  const bool alone = holding == 1;
  const double limit =
      alone ? std::min(options.max_sigma_translation, options.max_sigma_translation_alone)
            : options.max_sigma_translation;
  Doubts doubts = 0;
  const auto add = [&](bool holds, Doubt doubt) {
    if (holds) doubts = static_cast<Doubts>(doubts | doubt);
  };
  add(main.confirmations < options.confirm_sets, kUnconfirmed);
  add(state.count > 1, kSeveralPoses);
  add(alike.ambiguous(main), kAmbiguous);
  add(state.published.own_sigma_translation() > limit, kWeakPosition);
  add(largest_sigma(alike.known_rotation(covariance.topLeftCorner<3, 3>())) >
          options.max_sigma_rotation,
      kWeakRotation);
  add(alone && (options.one_camera_is_degraded || (doubts & kWeakPosition) != 0), kOneCamera);
  add(contradicted, kContradicted);
  return doubts;
}

void classify(Time time, bool contradicted, const EstimatorOptions& options,
              const AlikePoses& alike, BankState& state) {
  PoseEstimate& out = state.published;
  out.doubts = 0;
  if (state.count == 0) {
    const bool long_ago = time - out.last_measured > options.searching_after;
    out.state = state.found_before && !long_ago ? TrackState::kLost : TrackState::kSearching;
    return;
  }
  const int holding = holding_cameras(time, options, state);
  if (holding == 0) {
    out.state = TrackState::kCoasting;
    out.doubts = alike.ambiguous(state.hypotheses[0]) ? kAmbiguous : 0;
    return;
  }
  out.doubts = doubts_of(holding, contradicted, options, alike, state);
  out.state = out.doubts == 0 ? TrackState::kTracking : TrackState::kDegraded;
}

// The filter takes a camera's systematic error for new in every frame and averages it away. What is
// published is in no direction surer than the systematic error of the cameras that hold the object.
void keep_systematic(const Matrix6& information, const Matrix6& steady, PoseEstimate& estimate) {
  if (information.isZero(0.0) && steady.isZero(0.0)) return;
  Matrix6 least = steady;
  if (!information.isZero(0.0)) {
    const Matrix6 bounded = information + Matrix6(anywhere_covariance().inverse());
    least += bounded.ldlt().solve(Matrix6::Identity());
  }
  const Eigen::LLT<Matrix6> root(estimate.pose_covariance());  // P = L L^T
  Matrix6 relative = root.matrixL().solve(least);
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

Duration hold(const CameraRecord& record, const EstimatorOptions& options) {
  if (record.period == Duration(0)) return options.max_hold;
  return std::min(options.max_hold, from_seconds(options.hold_periods * to_seconds(record.period)));
}

Time held_until(const BankState& state, const EstimatorOptions& options) {
  Time until = Time::min();
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const CameraRecord& record = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    if (record.seen) until = std::max(until, record.last_look + hold(record, options));
  }
  return until;
}

namespace {

// Only what other cameras say since its own last look can tell that a camera is off.
bool others_spoke(CameraId camera, CameraSet accepted, const EstimatorOptions& options, Time time,
                  const BankState& before) {
  if ((accepted & ~camera_bit(camera)) != 0) return true;
  const CameraRecord& own = before.cameras[slot(camera)];
  for (CameraSet left = before.known & ~camera_bit(camera); left != 0; left &= left - 1) {
    const CameraRecord& other = before.cameras[static_cast<size_t>(std::countr_zero(left))];
    const bool fresh = time - other.last_look <= hold(other, options);
    if (other.seen && fresh && other.last_look > own.last_look) return true;
  }
  return false;
}

// Steps by the score of the variance (its likelihood's slope), so that sets that do not test the
// camera do not teach either.
void learn_systematic(const Agreement& agreement, CameraRecord& record) {
  const double step =
      kSystematicGain * (agreement.squared - kSystematicMargin * agreement.expected) / 6.0;
  const double proof =
      kProofGain * (agreement.squared - kSystematicMargin * agreement.expected) / 6.0;
  record.unproven =
      std::clamp(record.unproven * std::exp(std::min(proof, kSystematicJump)), kLeastUnproven, 1.0);
  record.systematic = std::clamp(record.systematic * std::exp(std::min(step, kSystematicJump)),
                                 kMinSystematic, kMaxSystematic);
}

// Of two cameras that disagree nobody knows which is wrong, and the one that is trusted less would
// be blamed more and more. So each is drawn to the mean of those that hold the object.
void share_blame(CameraId camera, Time time, const EstimatorOptions& options, BankState& state) {
  double sum = 0;
  int count = 0;
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const CameraRecord& other = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    if (!other.seen || time - other.last_look > hold(other, options)) continue;
    sum += std::log(other.systematic);
    ++count;
  }
  if (count == 0) return;
  CameraRecord& own = state.cameras[slot(camera)];
  own.systematic *= std::exp(kSharedBlame * (sum / count - std::log(own.systematic)));
}

}  // namespace

bool record_looks(Time time, std::span<const Observation> set, const Outcome* best,
                  const EstimatorOptions& options, BankState& state) {
  const CameraSet accepted = best != nullptr ? best->accepted : 0;
  const CameraSet gated = best != nullptr ? best->gated : 0;
  bool lost_a_friend = false;
  if (options.learn_systematic) {
    for (const Observation& observation : set) {
      const CameraId camera = observation.camera;
      if ((accepted & camera_bit(camera)) == 0) continue;
      if (!others_spoke(camera, accepted, options, time, state)) continue;
      learn_systematic(best->agreement[slot(camera)], state.cameras[slot(camera)]);
      share_blame(camera, time, options, state);
    }
  }
  for (const Observation& observation : set) {
    const CameraSet bit = camera_bit(observation.camera);
    CameraRecord& record = state.cameras[slot(observation.camera)];
    lost_a_friend |= (gated & bit) != 0 && !record.refused;
    update_period(time, record);
    record.known = true;
    record.last_look = time;
    record.seen = (accepted & bit) != 0;
    record.refused = (gated & bit) != 0;
    state.known |= bit;
    if (!record.seen) continue;
    if (options.learn_systematic) remember(best->pulls[slot(observation.camera)], options, record);
    record.scale +=
        kScaleSmoothing * (best->normalized_cost[slot(observation.camera)] - record.scale);
  }
  if (accepted != 0 && options.learn_systematic) {
    state.steady = steady_share(holders(time, options, state), options, state);
  }
  state.gated = gated;
  state.iterations = best != nullptr ? best->iterations : 0;
  return accepted == 0 && lost_a_friend;
}

void publish(Time time, bool contradicted, const EstimatorOptions& options, const AlikePoses& alike,
             BankState& state) {
  PoseEstimate& out = state.published;
  if (state.count > 0) {
    out = state.hypotheses[0].estimate;
    state.found_before = true;
    const int holding = std::max(1, holding_cameras(time, options, state));
    const Matrix6& systematic = state.hypotheses[0].systematic_information;
    keep_systematic(systematic, Matrix6::Zero(), out);
    // Beside the covariance: observers place their lines by that, next to where the filter is.
    PoseEstimate wide = out;
    keep_systematic(systematic, state.steady / holding * systematic_covariance(options), wide);
    const Matrix6 steady = wide.own_covariance() - out.own_covariance();
    add_spread(state, out);
    out.alternatives = alike.spread(state.hypotheses[0]) + steady;
  } else {
    out.cameras = 0;
  }
  out.time = time;
  classify(time, contradicted, options, alike, state);
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
