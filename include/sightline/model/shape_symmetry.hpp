// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// How an object's shape repeats itself. Plain value; any thread.
struct ShapeSymmetry {
  static constexpr size_t kMax = 31;  ///< rotations that are told apart

  /// The poses T and T * rotation have the same shape, and are not the same to whoever asks for the
  /// pose. Transforms of the object frame, without the identity; at most kMax.
  std::vector<Rigid3> rotations;
  /// The same, but a small part of the shape (a handle) tells them apart where it shows. Together
  /// with `rotations` at most kMax.
  std::vector<Rigid3> near_rotations;
  /// Rotations about this axis (unit) through a point on it, object frame, leave the shape as it
  /// is, so that outline and edges know nothing of them.
  struct Axis {
    Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    bool declared = false;  ///< they mean nothing to whoever asks for the pose either
  };
  std::optional<Axis> axis;
  /// The same, but a small part of the shape tells them; not set beside `axis`.
  std::optional<Axis> near_axis;

  /// Other poses look (nearly) the same, and so few that each can be drawn to compare its colors:
  /// the sides of a box, not the turns of a pot. 30 of those cost 18 ms a look.
  bool has_few_rotations() const {
    const size_t count = rotations.size() + near_rotations.size();
    return count > 0 && count <= 7;
  }
};

}  // namespace sightline
