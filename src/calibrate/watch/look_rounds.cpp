// SPDX-License-Identifier: Apache-2.0
#include "calibrate/watch/look_rounds.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace sightline::calibrate {
namespace {

constexpr double kMinQuality = 0.2;
// A step to a camera's own minimum may be about so long before it is held back [rad, m].
constexpr double kStepRotation = 0.1, kStepTranslation = 0.1;
constexpr int kSteps = 2;
// Of the liveliest motion's noise; what is more shows in the scatter (CameraEvidence::scale()).
constexpr double kCalm = 0.5;
// A motion that the track knows no better than this carries nothing from one time to another.
constexpr Duration kMaxAge = std::chrono::milliseconds(120);

struct Sum {
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  int residuals = 0;
  double quality = 0;
};

Sum linearize(const Observation& observation, const Rigid3& pose) {
  Sum sum;
  for (const PoseTermPtr& term : observation.terms) {
    const LinearizedTerm part = term->linearize(pose);
    if (part.residuals <= 0) continue;
    sum.information += part.information;
    sum.gradient += part.gradient;
    sum.residuals += part.residuals;
    sum.quality += part.quality * part.residuals;
  }
  if (sum.residuals > 0) sum.quality /= sum.residuals;
  return sum;
}

// Nobody sees a turn about the axis of a round shape: with u its tangent and s^T what measures it,
// M = I - u s^T leaves nothing of it.
void remove_rotation_about(const ShapeSymmetry::Axis& axis, Look& look) {
  Vector6 u, s;
  u << axis.direction, axis.point.cross(axis.direction);
  s << axis.direction, Eigen::Vector3d::Zero();
  const Matrix6 kept = Matrix6::Identity() - u * s.transpose();
  look.information = (kept.transpose() * look.information * kept).eval();
  look.gradient = (kept.transpose() * look.gradient).eval();
}

// Robust terms that are far from their minimum know little; so they are linearized next to it.
bool take_look(const Observation& observation, const Rigid3& start, Look& look) {
  Vector6 damping;
  damping << Eigen::Vector3d::Constant(1 / (kStepRotation * kStepRotation)),
      Eigen::Vector3d::Constant(1 / (kStepTranslation * kStepTranslation));
  look.reference = start;
  Sum sum;
  for (int i = 0; i < kSteps; ++i) {
    sum = linearize(observation, look.reference);
    if (sum.residuals == 0 || !sum.information.allFinite() || !sum.gradient.allFinite()) {
      return false;
    }
    if (i + 1 == kSteps) break;
    Matrix6 damped = sum.information;
    damped.diagonal() += damping;
    look.reference = look.reference * Rigid3::exp(-damped.ldlt().solve(sum.gradient));
  }
  look.time = observation.capture;
  look.information = sum.information;
  look.gradient = sum.gradient;
  return sum.quality >= kMinQuality;
}

// The look is off by an unknown pose error of covariance `spread`.
void integrate_out(const Matrix6& spread, Look& look) {
  const Eigen::PartialPivLU<Matrix6> mix(Matrix6::Identity() + look.information * spread);
  look.gradient = mix.solve(look.gradient).eval();
  const Matrix6 information = mix.solve(look.information);
  look.information = 0.5 * (information + information.transpose());
}

// The filter's own twist leans towards the camera that was the last before; what the object moved
// by meanwhile does not.
constexpr Duration kMotionSpan = std::chrono::milliseconds(50);
Vector6 mean_twist(const PoseTrack& track, Time time, const Vector6& otherwise) {
  const PoseAt before = track.at(time - kMotionSpan), after = track.at(time + kMotionSpan);
  if (before.source != PoseSource::kInterpolated && before.source != PoseSource::kEstimated) {
    return otherwise;
  }
  if (after.source == PoseSource::kNone) return otherwise;
  return difference(before.estimate.world_from_object, after.estimate.world_from_object) /
         to_seconds(2 * kMotionSpan);
}

bool is_known(const PoseAt& at) {
  return at.source != PoseSource::kNone &&
         (at.estimate.state == TrackState::kTracking || at.estimate.state == TrackState::kDegraded);
}

}  // namespace

LookRounds::LookRounds(size_t cameras, Duration round, const ShapeSymmetry& shape_symmetry)
    : round_(round) {
  unobservable_axis_ = shape_symmetry.axis ? shape_symmetry.axis : shape_symmetry.near_axis;
  for (LookRound& r : rounds_) r.looks.resize(cameras);
}

void LookRounds::clear() {
  newest_ = -1;
  for (LookRound& round : rounds_) round.tick = -1;
}

const LookRound* LookRounds::add(const Observation& observation, const PoseTrack& track) {
  const int64_t tick = observation.capture.time_since_epoch() / round_;
  if (newest_ >= 0 && tick < newest_ - 1) {
    if (tick < newest_ - 100) clear();  // a recording that begins anew
    return nullptr;
  }
  const LookRound* complete = nullptr;
  LookRound& round = rounds_[static_cast<size_t>(tick % 3)];
  if (round.tick != tick) {
    round.tick = tick;
    for (Look& look : round.looks) look.usable = false;
  }
  if (tick > newest_) {
    const int64_t left = newest_ - 1;  // two rounds before this one or earlier
    if (left >= 0 && tick <= newest_ + 1) {
      const LookRound& last = rounds_[static_cast<size_t>(left % 3)];
      if (last.tick == left) complete = &last;
    }
    newest_ = tick;
  }
  if (observation.terms.empty()) return complete;
  Look& look = round.looks.at(observation.camera.index());
  if (look.usable) return complete;
  const PoseAt at = track.at(observation.capture);
  if (!is_known(at)) return complete;
  look.usable = take_look(observation, at.estimate.world_from_object, look);
  if (look.usable && unobservable_axis_) remove_rotation_about(*unobservable_axis_, look);
  return complete;
}

bool RoundComparison::load(const LookRound& round, const PoseTrack& track) {
  looks_.resize(round.looks.size());
  Duration sum{0};
  Time first{};
  int count = 0;
  for (const Look& look : round.looks) {
    if (!look.usable) continue;
    if (count == 0) first = look.time;
    sum += look.time - first;
    ++count;
  }
  if (count < 2) return false;
  const Time middle = first + sum / count;
  const PoseAt at = track.at(middle);
  if (!is_known(at) || at.estimate.last_measured < middle - kMaxAge) return false;
  world_from_object_ = at.estimate.world_from_object;
  const Matrix6 twist_covariance = at.estimate.covariance.bottomRightCorner<6, 6>();
  const Vector6 twist = mean_twist(track, middle, at.estimate.twist);
  const double angular = kCalm * MotionNoise().angular, linear = kCalm * MotionNoise().linear;
  for (size_t i = 0; i < looks_.size(); ++i) {
    Look& look = looks_[i] = round.looks[i];
    if (!look.usable) continue;
    const double dt = to_seconds(look.time - middle);
    const Rigid3 there = world_from_object_ * Rigid3::exp(twist * dt);
    look.gradient += look.information * difference(look.reference, there);
    look.reference = world_from_object_;
    if (look.time == middle) continue;
    Matrix6 spread = dt * dt * twist_covariance;
    const double cube = std::abs(dt * dt * dt) / 3;
    spread.diagonal().head<3>().array() += angular * angular * cube;
    spread.diagonal().tail<3>().array() += linear * linear * cube;
    integrate_out(spread, look);
  }
  return true;
}

// With d the object's tangent, A = Ad(object_from_camera) and c the camera's, the camera's cost is
// that of d - A c. The others leave d of N(-R^-1 r, R^-1), the camera's own minimum lies at
// -H^-1 g; so A c has information S = H (H + R)^-1 R and S times its mean is
// R (H + R)^-1 g - H (H + R)^-1 r, also where H or R knows nothing of a direction.
bool RoundComparison::compare(size_t camera, const Rigid3& world_from_camera,
                              const std::vector<char>& voters, Correction& out) const {
  Matrix6 rest = Matrix6::Zero();
  Vector6 rest_gradient = Vector6::Zero();
  bool any = false;
  for (size_t i = 0; i < looks_.size(); ++i) {
    if (i == camera || !looks_[i].usable || voters[i] == 0) continue;
    rest += looks_[i].information;
    rest_gradient += looks_[i].gradient;
    any = true;
  }
  if (!any) return false;
  const Look& own = looks_[camera];
  Matrix6 both = own.information + rest;
  both.diagonal() += 1e-9 * both.diagonal() + Vector6::Constant(1e-6);
  const Eigen::LDLT<Matrix6> solver(both);
  const Matrix6 information = own.information * solver.solve(rest);
  const Vector6 vector =
      rest * solver.solve(own.gradient) - own.information * solver.solve(rest_gradient);
  const Matrix6 a = (world_from_object_.inverse() * world_from_camera).adjoint();
  out.information = a.transpose() * (0.5 * (information + information.transpose())) * a;
  out.vector = a.transpose() * vector;
  return out.information.allFinite() && out.vector.allFinite();
}

}  // namespace sightline::calibrate
