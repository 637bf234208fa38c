// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "../support/random.hpp"
#include "sightline/calibrate/capture_guide.hpp"
#include "synthetic_views.hpp"

namespace sightline::test {

/// Somebody who shows a target to the cameras of a synthetic rig as a guide asks: walks to each
/// pose, and holds the target still there with a hand that trembles.
class SimulatedUser {
 public:
  struct Habits {
    bool tilts = true;     ///< as asked; otherwise holds it square to the camera
    bool together = true;  ///< goes where two cameras see it
    double tremble_px = 0.15, noise_px = 0.1;
    double rate_hz = 10;  ///< of the cameras, which run freely
    double held_s = 0.8;
    uint64_t seed = 3;
  };

  SimulatedUser(const SyntheticRig& rig, const Habits& habits)
      : rig_(rig), habits_(habits), random_(habits.seed), nearness_(rig.truth.size(), 1) {}

  /// Hands each image to `see` until the pose that was asked for has been held.
  void follow(const CaptureAdvice& advice, const std::function<void(const TargetSight&)>& see);

  /// Corners that a camera sees of a target there.
  std::vector<TargetCorner> corners(size_t camera, const Rigid3& world_from_target,
                                    double noise_px);
  /// world_from_target as the advice asks.
  Rigid3 pose_for(const CaptureAdvice& advice);
  /// Holds it there and hands out the images.
  void hold(const Rigid3& world_from_target, const std::function<void(const TargetSight&)>& see);

 private:
  Rigid3 try_pose(const CaptureAdvice& advice);
  void show(const Rigid3& pose, double tremble_px, double seconds,
            const std::function<void(const TargetSight&)>& see);

  const SyntheticRig& rig_;
  Habits habits_;
  Random random_;
  std::vector<double> nearness_;  // by camera, factor on the usual distance
  Time now_{std::chrono::seconds(100)};
};

}  // namespace sightline::test
