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
  /// Unit, through the object's origin: turns about it mean nothing (declared symmetry), so that no
  /// measurement can know them.
  std::optional<Eigen::Vector3d> free_axis;

  bool none() const { return turns.empty() && !free_axis; }
};

}  // namespace sightline
