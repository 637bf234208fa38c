// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "sightline/model/pose_track.hpp"

namespace sightline::test {

enum class MotionKind : uint8_t {
  kStill,
  kConstantTwist,      ///< initial_twist, for ever
  kSinusoid,           ///< smooth, from sums of sines in every direction
  kWhiteAcceleration,  ///< the estimator's own model: twist is a random walk
};

struct MotionOptions {
  MotionKind kind = MotionKind::kSinusoid;
  Rigid3 start;                                   ///< world_from_object at time zero
  double linear_amplitude = 0.08;                 ///< [m] kSinusoid
  double angular_amplitude = 0.5;                 ///< [rad] kSinusoid
  double frequency_hz = 0.7;                      ///< of the slowest sine
  Vector6 initial_twist = Vector6::Zero();        ///< [rad/s, m/s] body
  Vector6 initial_twist_sigma = Vector6::Zero();  ///< added at random, kWhiteAcceleration
  MotionNoise noise;                              ///< kWhiteAcceleration
  /// The object is elsewhere from this time on: start and path are moved by it (world side).
  Time jump_at = Time::max();
  Rigid3 jump;
};

/// True pose and body twist of the object at any time from zero to the duration.
class SyntheticMotion {
 public:
  SyntheticMotion(const MotionOptions& options, Duration duration, uint64_t seed);

  Rigid3 pose(Time time) const;
  Vector6 twist(Time time) const;

 private:
  Rigid3 smooth_pose(Time time) const;

  MotionOptions options_;
  Eigen::Matrix<double, 6, 3> phases_;
  std::vector<Rigid3> grid_poses_;  // every millisecond, twist constant between
  std::vector<Vector6> grid_twists_;
};

}  // namespace sightline::test
