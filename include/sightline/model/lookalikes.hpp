// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// How an object's shape repeats itself. Plain value; any thread.
struct Lookalikes {
  static constexpr size_t kMost = 31;  ///< turns that are told apart

  /// A pose T and T * turn look alike by shape, and are not the same to whoever asks for the pose.
  /// Without the identity; at most kMost.
  std::vector<Rigid3> turns;
  /// Turns about this axis (unit) through a point on it, object frame, leave the shape as it is, so
  /// that outline and edges know nothing of them.
  struct Axis {
    Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    bool declared = false;  ///< they mean nothing to whoever asks for the pose either
  };
  std::optional<Axis> axis;
};

}  // namespace sightline
