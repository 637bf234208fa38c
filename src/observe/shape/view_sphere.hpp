// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace sightline::observe {

/// Directions spread evenly over the sphere: the icosahedron, its triangles split in four
/// `subdivisions` times. 10 * 4^n + 2 unit vectors, in an order that never changes.
struct ViewSphere {
  std::vector<Eigen::Vector3d> directions;
  std::vector<std::array<uint16_t, 6>> neighbors;  ///< ascending; the first `counts` are valid
  std::vector<uint8_t> counts;                     ///< 5 or 6
};
ViewSphere make_view_sphere(int subdivisions);

}  // namespace sightline::observe
