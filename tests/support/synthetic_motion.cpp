// SPDX-License-Identifier: Apache-2.0
#include "support/synthetic_motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "support/random.hpp"

namespace sightline::test {
namespace {

constexpr Duration kGrid = std::chrono::milliseconds(1);
constexpr double kStep = 1e-3;

}  // namespace

SyntheticMotion::SyntheticMotion(const MotionOptions& options, Duration duration, uint64_t seed)
    : options_(options) {
  Random random(seed);
  for (double& phase : phases_.reshaped()) phase = 2 * std::numbers::pi * random.uniform();
  if (options.kind != MotionKind::kWhiteAcceleration) return;
  Vector6 density;
  density << Eigen::Vector3d::Constant(options.noise.angular),
      Eigen::Vector3d::Constant(options.noise.linear);
  Rigid3 pose = options.start;
  Vector6 twist =
      options.initial_twist + Vector6(options.initial_twist_sigma.cwiseProduct(random.normal<6>()));
  const auto steps = static_cast<size_t>(duration / kGrid) + 2;
  for (size_t i = 0; i < steps; ++i) {
    grid_poses_.push_back(pose);
    grid_twists_.push_back(twist);
    pose = pose * Rigid3::exp(twist * kStep);
    twist += std::sqrt(kStep) * Vector6(density.cwiseProduct(random.normal<6>()));
  }
}

Rigid3 SyntheticMotion::smooth_pose(Time time) const {
  const double t = to_seconds(time.time_since_epoch());
  switch (options_.kind) {
    case MotionKind::kStill:
      return options_.start;
    case MotionKind::kConstantTwist:
      return options_.start * Rigid3::exp(options_.initial_twist * t);
    case MotionKind::kSinusoid: {
      Vector6 offset = Vector6::Zero();
      for (int i = 0; i < 6; ++i) {
        for (int k = 0; k < 3; ++k) {
          const double frequency = options_.frequency_hz * (1.0 + 0.37 * k + 0.05 * i);
          offset[i] += std::sin(2 * std::numbers::pi * frequency * t + phases_(i, k)) / (k + 1.0);
        }
      }
      offset.head<3>() *= 0.5 * options_.angular_amplitude;
      const Eigen::Vector3d shift = 0.5 * options_.linear_amplitude * offset.tail<3>();
      Vector6 turn = Vector6::Zero();
      turn.head<3>() = offset.head<3>();
      return Rigid3(Eigen::Quaterniond::Identity(), shift) * options_.start * Rigid3::exp(turn);
    }
    case MotionKind::kWhiteAcceleration: {
      const auto index =
          std::min(static_cast<size_t>(time.time_since_epoch() / kGrid), grid_poses_.size() - 1);
      const double rest = t - kStep * static_cast<double>(index);
      return grid_poses_[index] * Rigid3::exp(grid_twists_[index] * rest);
    }
  }
  return options_.start;
}

Rigid3 SyntheticMotion::pose(Time time) const {
  const Rigid3 smooth = smooth_pose(time);
  return time < options_.jump_at ? smooth : options_.jump * smooth;
}

Vector6 SyntheticMotion::twist(Time time) const {
  if (options_.kind == MotionKind::kWhiteAcceleration) {
    const auto index =
        std::min(static_cast<size_t>(time.time_since_epoch() / kGrid), grid_twists_.size() - 1);
    return grid_twists_[index];
  }
  constexpr double kHalf = 1e-5;
  return difference(smooth_pose(time - from_seconds(kHalf)),
                    smooth_pose(time + from_seconds(kHalf))) /
         (2 * kHalf);
}

}  // namespace sightline::test
