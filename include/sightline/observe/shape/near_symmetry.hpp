// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline {

/// By how much the object looks different from one side after a turn: shares of its silhouette.
struct TurnDifference {
  double silhouette = 0;  ///< pixels that only one of both covers, over all that either covers
  double surface = 0;     ///< those, and pixels where the surface is nearer or farther
};

/// A turn (about an axis near the middle of the surface) after which the object looks nearly the
/// same.
struct NearSymmetry {
  Eigen::AngleAxisd turn;  ///< object frame; 0 < angle <= pi
  Rigid3 transform;        ///< the turn about where its axis is: T and T * transform look alike
  TurnDifference mean;     ///< over views from all sides
  double least = 0;        ///< of the silhouette, over the views: from there ...
  Eigen::Vector3d hides;   ///< ... (object frame, towards the camera) nothing tells the turn
  double most = 0;
  Eigen::Vector3d shows;  ///< from there it tells most
};

/// What is nearly symmetric.
struct NearSymmetries {
  /// The turns that differ least from what they lead to: local minima over the angle, at most 15 %
  /// of the silhouette, least first.
  std::vector<NearSymmetry> turns;
  /// Axes about which no turn changes more than 20 % of the silhouette and 35 % of the surface, and
  /// the turn that changes most: a bottle, a cup with a small handle.
  std::vector<NearSymmetry> axes;
};

/// The transforms that a pose is to be compared with: about axes in steps of 15 degrees, the others
/// and their inverses. Those that differ least come first; `most` at most. None that `same` holds
/// for (exact symmetries).
std::vector<Rigid3> near_rotations_of(const NearSymmetries& near, size_t most,
                                      const std::function<bool(const Rigid3&)>& same);

/// The first of the axes, with a point on it; nothing without one.
std::optional<ShapeSymmetry::Axis> near_axis_of(const NearSymmetries& near);

/// Draws the mesh from 42 sides, as it is and turned about its principal axes in steps of 15
/// degrees, improves the best by small steps, and compares the pictures (128 px). Colors do not
/// count. About a second. Exact symmetries are among the turns, with differences near 0.
Result<NearSymmetries> find_near_symmetries(const TriangleMesh& mesh,
                                            const DepthRendererFactory& factory);

}  // namespace sightline
