// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"

namespace sightline::observe {

/// A flat set of points: what one marker or board shows.
struct PlanarView {
  Rigid3 object_from_plane;             ///< the points have z = 0 in the plane's frame
  std::vector<Eigen::Vector2d> points;  ///< in the plane [m]
  std::vector<Eigen::Vector2d> pixels;
};

/// The two poses of a plane that explain a view of it (Collins and Bartoli, "Infinitesimal
/// plane-based pose estimation", 2014), as camera_from_plane, better one first; fewer if points are
/// fewer than four, on one line, or beyond the lens.
std::vector<Rigid3> plane_poses(const CameraModel& camera, const PlanarView& view);

/// Levenberg-Marquardt on one term from `start`; the pose it ends at and its cost.
PoseHypothesis refine_pose(const PoseTerm& term, const Rigid3& start, int max_steps = 20);

/// Stand-alone poses of an object seen in `views`, best first: all starts from all views refined on
/// `term`, the same ones merged, and those left out that cost more than `margin` above the best.
std::vector<PoseHypothesis> pose_hypotheses(const ReprojectionTerm& term,
                                            const std::vector<PlanarView>& views, double margin);

}  // namespace sightline::observe
