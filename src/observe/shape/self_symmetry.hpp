// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::observe {

/// How a shape repeats itself: rotations that leave it as it is, colors aside.
struct SelfSymmetry {
  /// A ring, a bottle: every rotation about this axis (unit) through `middle` leaves it as it is.
  std::optional<Eigen::Vector3d> axis;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< of the surface; on the axis
  /// Single rotations, without the identity; those about `axis` are left out, and of rotations that
  /// differ by one about it only one is kept. Object frame.
  std::vector<Rigid3> rotations;
};

/// Finds them by trying: rotations about the middle of the surface that keep its second moments,
/// each improved until the rotated surface lies on itself as well as it can (iterated closest
/// points: Besl and McKay, 1992). A shape counts as repeated if 95 % of the surface come to lie
/// within 2 % of the radius of the bounding sphere and all of it within 6 %: what differs by less
/// than that is a pixel on an object of a hundred. A sphere has none. About 0.1 s;
/// deterministic.
SelfSymmetry find_self_symmetry(const TriangleMesh& mesh);

}  // namespace sightline::observe
