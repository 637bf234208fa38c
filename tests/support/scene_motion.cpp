// SPDX-License-Identifier: Apache-2.0
#include "support/scene_motion.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "support/random.hpp"

namespace sightline::test {
namespace {

/// Poses on a grid of times from zero on, joined at constant twist.
ScenePath on_grid(std::vector<Rigid3> poses, Duration grid) {
  const auto shared = std::make_shared<const std::vector<Rigid3>>(std::move(poses));
  return [shared, grid](Time time) {
    const double at = std::max(0.0, to_seconds(time.time_since_epoch()) / to_seconds(grid));
    const auto low = std::min(static_cast<size_t>(at), shared->size() - 2);
    const Vector6 step = difference((*shared)[low], (*shared)[low + 1]);
    return (*shared)[low] * Rigid3::exp(step * (at - static_cast<double>(low)));
  };
}

Eigen::Quaterniond any_turn(Random& random) {
  return Eigen::Quaterniond(random.normal<4>().normalized());
}

}  // namespace

ScenePath smooth_path(const SceneSteps& steps, Duration duration) {
  constexpr Duration kGrid = std::chrono::milliseconds(1);
  constexpr int kWaves = 3;
  const double seconds = to_seconds(duration) + 1;
  const auto count = static_cast<size_t>(seconds / to_seconds(kGrid)) + 2;
  Random random(steps.seed);
  double phase[2][3][kWaves];
  for (auto& kind : phase) {
    for (auto& axis : kind) {
      for (double& each : axis) each = random.uniform(0, 2 * std::numbers::pi);
    }
  }
  // Sines of unit size, each axis and wave with a frequency of its own; pace(1) is one radian per
  // second for the slowest.
  const auto wave = [&](int kind, int axis, double at) {
    double sum = 0;
    for (int k = 0; k < kWaves; ++k) {
      sum += std::sin(at * (1 + 0.61 * k + 0.13 * axis) + phase[kind][axis][k]) / (1 + k);
    }
    return sum / 1.84;
  };
  const auto place = [&](double at) -> Eigen::Vector3d {
    return Eigen::Vector3d(wave(0, 0, at), wave(0, 1, at), wave(0, 2, at))
        .cwiseProduct(steps.half_room);
  };
  double path = 0;
  constexpr int kSamples = 4000;
  for (int i = 0; i < kSamples; ++i) path += (place(0.01 * (i + 1)) - place(0.01 * i)).norm();
  const double length_per_unit = path / (0.01 * kSamples);
  const double pace = steps.step / to_seconds(steps.period) / length_per_unit;

  const auto spin = [&](double at) {
    return Eigen::Vector3d(wave(1, 0, at), wave(1, 1, at), wave(1, 2, at));
  };
  double turned = 0;
  for (int i = 0; i < kSamples; ++i) turned += spin(0.01 * i).norm() / kSamples;
  const double spin_scale = steps.turn / to_seconds(steps.period) / turned;
  const double spin_pace = std::max(pace, 0.5);

  std::vector<Rigid3> poses;
  Eigen::Quaterniond rotation = any_turn(random);
  for (size_t i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) * to_seconds(kGrid);
    poses.emplace_back(rotation, steps.middle + place(pace * t));
    Vector6 turn = Vector6::Zero();
    turn.head<3>() = spin_scale * to_seconds(kGrid) * spin(spin_pace * t);
    rotation = (Rigid3(rotation, Eigen::Vector3d::Zero()) * Rigid3::exp(turn)).rotation;
  }
  return on_grid(std::move(poses), kGrid);
}

ScenePath erratic_path(const SceneSteps& steps, Duration duration) {
  Random random(steps.seed);
  const auto count = static_cast<size_t>(duration / steps.period) + 3;
  std::vector<Rigid3> poses = {Rigid3(any_turn(random), steps.middle)};
  while (poses.size() < count) {
    Eigen::Vector3d next;
    do {
      next = poses.back().translation + steps.step * random.normal<3>().normalized();
    } while (((next - steps.middle).cwiseAbs().array() > steps.half_room.array()).any());
    Vector6 turn = Vector6::Zero();
    turn.head<3>() = steps.turn * random.normal<3>().normalized();
    const Rigid3 turned =
        Rigid3(poses.back().rotation, Eigen::Vector3d::Zero()) * Rigid3::exp(turn);
    poses.emplace_back(turned.rotation, next);
  }
  return on_grid(std::move(poses), steps.period);
}

ScenePath resting(const Rigid3& world_from_object) {
  return [world_from_object](Time) { return world_from_object; };
}

}  // namespace sightline::test
