// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/observe/corner_term.hpp"

namespace sightline::observe {

using Matrix12 = Eigen::Matrix<double, 12, 12>;
using Vector12 = Eigen::Matrix<double, 12, 1>;

/// One camera of a rig and when its picture was taken.
struct RigView {
  std::shared_ptr<const CalibratedCamera> camera;
  double seconds = 0;  ///< after the reference time
};

/// A point of the object and where one of the cameras may have seen it.
struct RigMatch {
  size_t view = 0;
  PointMatch match;
  Eigen::Vector3d seen_from;  ///< unit, object frame: from where the point looks like this
};

/// An object's motion through several pictures: where it is at the reference time and its twist
/// (body frame). At a picture's own time it is at world_from_object * exp(twist * seconds).
struct RigMotion {
  Rigid3 world_from_object;
  Vector6 twist = Vector6::Zero();  ///< [rad/s, m/s]

  Rigid3 at(double seconds) const { return world_from_object * Rigid3::exp(twist * seconds); }
};

/// What the terms of all pictures (null: none) say together of a motion: with d the tangent of
/// (pose, twist), cost + gradient . d + d . information d / 2. The twist has a prior about zero,
/// one sigma 3.5 rad/s and 1 m/s; d of a picture's pose is Ad(exp(-twist s)) d_pose + s J_r(twist
/// s) d_twist (Sola et al., 2018).
struct RigSystem {
  Matrix12 information = Matrix12::Zero();
  Vector12 gradient = Vector12::Zero();
  double cost = 0;
};
RigSystem linearize_rig(std::span<const PoseTermPtr> terms, std::span<const RigView> views,
                        const RigMotion& motion);

/// Levenberg-Marquardt on all pictures at once. The twist stays if they were taken together.
RigMotion refine_rig(std::span<const PoseTermPtr> terms, std::span<const RigView> views,
                     const RigMotion& start, int max_steps = 10);

/// Half the squared twist by its prior.
double twist_cost(const Vector6& twist);

struct RigPoseOptions {
  double inlier_px = 3;  ///< error of a match that supports a pose
  double slack = 0.6;    ///< [m/s] that the object may move by before its twist is known
  double facing = 0.5;   ///< cosine between where a point is seen from and where it was taught from
  int trials = 1500;     ///< samples of three matches, at most
  size_t kept = 8;       ///< of their poses that are refined
  double huber = 2.5;    ///< [sigma]
  ViewError view_error{0.3, 0.005};
  uint64_t seed = 1;
};

/// A pose that matches support.
struct RigPose {
  RigMotion motion;
  std::vector<size_t> inliers;     ///< matches that it projects close to where they were seen
  double support = 0;              ///< sum over them of 1 - (error / inlier_px)^2
  std::vector<PoseTermPtr> terms;  ///< CornerTerm of each view's inliers; null without
};

/// Poses of an object from matches in all pictures of a rig, most support first: poses of three
/// matches of one camera (P3P), judged by the matches of all cameras (RANSAC with the truncated
/// cost of Torr and Zisserman, 2000; some samples are neighbours, Myatt et al., 2002), then fitted
/// to all of these at once through the exact lenses. Where a camera's supporting points lie in a
/// plane, its other pose (Collins and Bartoli, 2014) is tried as well, whichever sample was lucky.
/// Poses of less than half the best one's support are left out. Nothing depends on chance: the same
/// matches give the same poses.
std::vector<RigPose> solve_rig(std::span<const RigView> views, std::span<const RigMatch> matches,
                               const RigPoseOptions& options = {});

/// Angle between the line of sight and the normal of the plane that most of a view's supporting
/// points lie in [rad]; empty if they are not flat.
std::optional<double> flat_tilt(std::span<const RigView> views, const RigPose& pose, size_t view);

/// What matches say of any motion: inliers, support and terms; nothing is moved. `slack` [m/s]
/// widens the neighbourhood of pictures of other times.
RigPose judge_rig(std::span<const RigView> views, std::span<const RigMatch> matches,
                  const RigMotion& motion, const RigPoseOptions& options, double inlier_px,
                  double slack = 0);

}  // namespace sightline::observe
