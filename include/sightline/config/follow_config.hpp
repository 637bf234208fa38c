// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/geometry/head_drive.hpp"

namespace sightline {

/// How a camera of role "follow" keeps objects in view: [camera.follow]. Angles as the calibration
/// counts them.
struct FollowConfig {
  std::vector<std::string> objects;  ///< the first that has a pose; empty: all, in their order
  HeadLimits limits;
  HeadAngles home = HeadAngles::Zero();           ///< where it waits
  Duration home_after = std::chrono::seconds(3);  ///< without a pose
  Duration scan{0};  ///< before it goes home it looks around for so long; 0: it does not
  Duration yield = std::chrono::seconds(10);  ///< to whoever else moves the head

  bool operator==(const FollowConfig&) const = default;
};

}  // namespace sightline
