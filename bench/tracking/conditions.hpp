// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sightline/model/object.hpp"
#include "support/scene_rig.hpp"

namespace sightline::bench {

/// Limits that a condition is held to; empty: none.
struct Targets {
  std::optional<double> position_mm, rotation_deg;  ///< medians
  std::optional<double> depth_mm;                   ///< median, along the first camera's axis
  std::optional<double> success;                    ///< share within 5 cm + 5 deg
};

/// How a sequence is driven.
enum class Start {
  kHeld,  ///< at the true pose, again after every failure (5 cm, 5 deg or no pose): the RBOT rule
  kCold,  ///< nothing is given: found, lost and found again by the product alone
};

/// What the tracker is tried on.
struct Condition {
  std::string name;
  std::string what;
  Start start = Start::kHeld;
  test::SceneRigOptions rig;  ///< without path; seeds are set per sequence
  test::SceneSteps steps;
  bool erratic = false;
  bool told = true;  ///< a given pose is said to be the right one of those that look alike
  Symmetry symmetry = Symmetry::kNone;
  /// The object comes in from outside after so long: until then nothing is judged but wrong claims.
  Duration enters{0};
  size_t settle = 10;  ///< sets after a start that do not count as errors
  Targets targets;
};

/// All conditions of docs/accuracy.md. Object: the creature of about 15k faces at 0.7 m, 90 px,
/// 640x480, f = 600 px, lens with distortion, unless the condition says otherwise.
std::vector<Condition> tracking_conditions(Duration duration);

/// The rig of one sequence: everything random follows from the seed.
test::SceneRigOptions rig_of(const Condition& condition, uint64_t seed);

}  // namespace sightline::bench
