// SPDX-License-Identifier: Apache-2.0
#include "sightline/model/pose_track.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

namespace sightline {
namespace {

using Matrix12 = Eigen::Matrix<double, 12, 12>;

double largest_sigma(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

Eigen::Vector3d largest_direction(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  return solver.eigenvectors().col(2);  // eigenvalues ascend
}

// Perturbing pose and twist on the right and carrying both through pose * exp(twist * dt).
Matrix12 transition(const Vector6& twist, double dt) {
  Matrix12 f = Matrix12::Identity();
  f.topLeftCorner<6, 6>() = Rigid3::exp(-twist * dt).adjoint();
  f.topRightCorner<6, 6>() = right_jacobian(twist * dt) * dt;
  return f;
}

// White-noise acceleration integrated over dt. Backwards in time the variances grow alike and the
// covariance of pose and twist changes its sign.
void add_process_noise(double dt, const MotionNoise& noise, Matrix12& covariance) {
  Vector6 density;
  density << Eigen::Vector3d::Constant(noise.angular * noise.angular),
      Eigen::Vector3d::Constant(noise.linear * noise.linear);
  const double span = std::abs(dt);
  for (int i = 0; i < 6; ++i) {
    covariance(i, i) += density(i) * span * span * span / 3;
    covariance(i, i + 6) += density(i) * dt * span / 2;
    covariance(i + 6, i) += density(i) * dt * span / 2;
    covariance(i + 6, i + 6) += density(i) * span;
  }
}

// Of two states that have a pose, the one that claims less.
TrackState weaker(TrackState a, TrackState b) { return std::max(a, b); }

PoseEstimate interpolate(const PoseEstimate& a, const PoseEstimate& b, Time time) {
  const double s = to_seconds(time - a.time) / to_seconds(b.time - a.time);
  PoseEstimate result = a;
  result.time = time;
  result.state = weaker(a.state, b.state);
  result.world_from_object =
      a.world_from_object * Rigid3::exp(s * difference(a.world_from_object, b.world_from_object));
  result.twist = (1 - s) * a.twist + s * b.twist;
  result.covariance = (1 - s) * a.covariance + s * b.covariance;
  result.alternatives = (1 - s) * a.alternatives + s * b.alternatives;
  result.degraded_reasons = a.degraded_reasons | b.degraded_reasons;
  result.cameras = 0;
  return result;
}

}  // namespace

std::string_view to_string(TrackState state) {
  switch (state) {
    case TrackState::kSearching:
      return "searching";
    case TrackState::kTracking:
      return "tracking";
    case TrackState::kDegraded:
      return "degraded";
    case TrackState::kCoasting:
      return "coasting";
    case TrackState::kLost:
      return "lost";
  }
  return "unknown";
}

std::string to_string(DegradedReasons degraded_reasons, std::string_view separator) {
  static constexpr std::array<std::string_view, 10> kNames = {
      "unconfirmed", "several_poses", "ambiguous",   "weak_position", "weak_rotation",
      "one_camera",  "contradicted",  "unexplained", "possible_swap", "flat_print"};
  std::string text;
  for (size_t i = 0; i < kNames.size(); ++i) {
    if ((degraded_reasons >> i & 1) == 0) continue;
    if (!text.empty()) text += separator;
    text += kNames[i];
  }
  return text;
}

double PoseEstimate::sigma_rotation() const {
  return largest_sigma(pose_covariance().topLeftCorner<3, 3>());
}

double PoseEstimate::sigma_translation() const {
  return largest_sigma(pose_covariance().bottomRightCorner<3, 3>());
}

double PoseEstimate::own_sigma_rotation() const {
  return largest_sigma(covariance.topLeftCorner<3, 3>());
}

double PoseEstimate::own_sigma_translation() const {
  return largest_sigma(covariance.block<3, 3>(3, 3));
}

Eigen::Vector3d PoseEstimate::weak_direction() const {
  return world_from_object.rotation * largest_direction(covariance.block<3, 3>(3, 3));
}

Eigen::Vector3d PoseEstimate::weak_axis() const {
  return world_from_object.rotation * largest_direction(covariance.topLeftCorner<3, 3>());
}

PoseEstimate predict(const PoseEstimate& from, Time to, const MotionNoise& noise) {
  const double dt = to_seconds(to - from.time);
  PoseEstimate result = from;
  result.time = to;
  result.world_from_object = from.world_from_object * Rigid3::exp(from.twist * dt);
  const Matrix12 f = transition(from.twist, dt);
  Matrix12 covariance = f * from.covariance * f.transpose();
  add_process_noise(dt, noise, covariance);
  result.covariance = 0.5 * (covariance + covariance.transpose());
  return result;
}

PoseAt PoseTrack::at(Time time) const {
  const auto next =
      std::lower_bound(history_.begin(), history_.end(), time,
                       [](const PoseEstimate& estimate, Time t) { return estimate.time < t; });
  if (next != history_.end() && next->time == time) {
    if (!has_pose(next->state)) return {};
    return {*next, PoseSource::kEstimated};
  }
  if (next == history_.begin()) return {};
  const PoseEstimate& before = *(next - 1);
  if (!has_pose(before.state)) return {};
  if (next != history_.end()) {
    if (!has_pose(next->state)) return {};
    return {interpolate(before, *next, time), PoseSource::kInterpolated};
  }
  const Duration unseen = time - before.last_measured;
  if (unseen > kCoastLimit) return {};
  PoseEstimate predicted = predict(before, time, noise_);
  predicted.cameras = 0;
  if (unseen > kFreshFor) predicted.state = TrackState::kCoasting;
  return {predicted, PoseSource::kPredicted};
}

}  // namespace sightline
