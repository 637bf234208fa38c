// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "observe/terms/rig_motion.hpp"
#include "observe/terms/surface_patch.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"

namespace sightline::observe {

/// One camera of a rig and when its image was taken.
struct RigView {
  std::shared_ptr<const CalibratedCamera> camera;
  double seconds = 0;  ///< after the reference time
};

/// A point of the object and where one of the cameras may have seen it.
struct RigMatch {
  size_t view = 0;
  PointMatch match;
  SurfacePatch trained;  ///< of the object
  ImagePatch seen;
};

/// What the terms of all images (null: none) say together of a motion.
MotionSystem linearize_rig(std::span<const PoseTermPtr> terms, std::span<const RigView> views,
                           const RigMotion& motion);

/// Levenberg-Marquardt on all images at once. The twist is kept if they were taken at the same
/// time.
RigMotion refine_rig(std::span<const PoseTermPtr> terms, std::span<const RigView> views,
                     const RigMotion& start, int max_steps = 10);

struct RigPoseOptions {
  double inlier_px = 3;  ///< error of a match that supports a pose
  double slack = 0.6;    ///< [m/s] that the object may move by before its twist is known
  PatchTolerance patch;  ///< of matches that support a pose
  int trials = 600;      ///< samples of three matches
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
  std::vector<PoseTermPtr> terms;  ///< ReprojectionTerm of each view's inliers; null without
};

/// Poses of an object from matches in all images of a rig (of a camera best first), most support
/// first. Each match makes two poses by itself (patch_poses()); matches that agree with one of
/// these roughly are a group (Lowe, 2004). Of three matches of a group there are up to four poses
/// (P3P), judged by the matches of all cameras, places and patches (truncated cost of Torr and
/// Zisserman, 2000), then fitted to all of these at once through the exact lenses. Where a camera's
/// supporting points lie in a plane, its other pose (Collins and Bartoli, 2014) is tried as well.
/// Poses of less than half the best one's support are left out. Nothing depends on chance: the same
/// matches give the same poses.
std::vector<RigPose> solve_rig(std::span<const RigView> views, std::span<const RigMatch> matches,
                               const RigPoseOptions& options = {});

/// Angle between the line of sight and the normal of the plane that most of a view's supporting
/// points lie in [rad]; empty if they are not flat.
std::optional<double> flat_tilt(std::span<const RigView> views, const RigPose& pose, size_t view);

/// What matches say of any motion: inliers, support and terms; nothing is moved. `slack` [m/s]
/// widens the neighborhood of images of other times.
RigPose judge_rig(std::span<const RigView> views, std::span<const RigMatch> matches,
                  const RigMotion& motion, const RigPoseOptions& options, double inlier_px,
                  double slack = 0);

}  // namespace sightline::observe
