// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "../support/random.hpp"
#include "sightline/calibrate/solve.hpp"
#include "sightline/calibrate/views.hpp"

namespace sightline::test {

struct SyntheticRigOptions {
  size_t cameras = 2;
  size_t sets = 40;
  LensModel lens = LensModel::kBrownConrady;
  double focal = 900;  ///< [px] at 1280x720
  double noise_px = 0.2;
  Eigen::Vector2d bend = Eigen::Vector2d::Zero();
  double square = 0.04;                  ///< [m]
  double tilt_deg = 40;                  ///< of the target, at most
  double nearest = 0.7, farthest = 1.5;  ///< [m]
  double offset_s = 0;                   ///< of every camera but the first
  double speed = 0;                      ///< of the target [m/s]
  double turn = 0;                       ///< about its middle [rad/s]
  double readout_s = 0;                  ///< of every second camera; of the others half, reversed
  /// Faces of a pillar in the middle, each a fixed grid of tags that cameras within 60 degrees see.
  size_t pillar = 0;
  bool two_at_a_time = false;  ///< nobody sees a set but the two cameras that it is shown to
  uint64_t seed = 1;
};

/// Cameras on a ring that look at its middle; the target is shown to two neighbors at a time, its
/// front towards them, so that hardly others see it.
struct SyntheticRig {
  CalibrationViews views;
  std::vector<CalibratedCamera> truth;  ///< world: the frame of the first camera
};
SyntheticRig make_rig(const SyntheticRigOptions& options);

/// A target with an even and an odd number of inner corners on its sides.
CalibrationTarget test_target();

}  // namespace sightline::test
