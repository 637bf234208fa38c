// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sightline/geometry/mesh.hpp"

namespace sightline::observe {

/// A point of a crease or border of the mesh, object frame [m].
struct CreasePoint {
  Eigen::Vector3f point;
  Eigen::Vector3f tangent;  ///< unit
};

/// Points along all edges whose faces meet under more than `crease_angle` [rad] and along borders,
/// at most `spacing` [m] apart. Vertices at the same place count as one. In the order of the mesh.
std::vector<CreasePoint> crease_points(const TriangleMesh& mesh, double crease_angle,
                                       double spacing);

}  // namespace sightline::observe
