// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>

#include "sightline/base/time.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::test {

/// world_from_object at any time from zero on.
using ScenePath = std::function<Rigid3(Time)>;

/// How far an object moves and turns from one frame to the next, and where it stays.
struct SceneSteps {
  double step = 0.0078;  ///< [m] per period
  double turn = 0.064;   ///< [rad] per period
  Duration period = std::chrono::nanoseconds(33'333'333);
  Eigen::Vector3d half_room = {0.10, 0.10, 0.07};  ///< [m] about `middle`
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  uint64_t seed = 1;
};

/// Sways and tumbles smoothly; `step` and `turn` are means over time.
ScenePath smooth_path(const SceneSteps& steps, Duration duration);

/// A step of exactly this size in a new direction every period, straight and even between: nothing
/// that could be predicted.
ScenePath erratic_path(const SceneSteps& steps, Duration duration);

/// Does not move.
ScenePath resting(const Rigid3& world_from_object);

}  // namespace sightline::test
