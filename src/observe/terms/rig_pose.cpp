// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/rig_pose.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "observe/terms/plane_pose.hpp"
#include "observe/terms/ray_pose.hpp"

namespace sightline::observe {
namespace {

constexpr double kSimultaneous = 1e-3;  // [s]
constexpr size_t kMinForPlane = 6;
constexpr double kFlat = 0.2;             // thickness of a plane's points by their width
constexpr double kMinSupportShare = 0.5;  // share of the best support that another pose needs

bool simultaneous(std::span<const RigView> views) {
  return std::all_of(views.begin(), views.end(),
                     [](const RigView& view) { return std::abs(view.seconds) < kSimultaneous; });
}

bool same_motion(const RigMotion& a, const RigMotion& b) {
  const Vector6 d = difference(a.world_from_object, b.world_from_object);
  return d.head<3>().norm() < 0.05 && d.tail<3>().norm() < 0.01;
}

// From a wide neighborhood to the close one, matches chosen anew each time.
RigPose fitted(std::span<const RigView> views, std::span<const RigMatch> matches,
               const RigMotion& start, const RigPoseOptions& options) {
  RigMotion motion = start;
  for (const double wider : {3.0, 2.0, 1.3, 1.0}) {
    const double slack = wider > 1.5 ? options.slack * (wider - 2) : 0;
    const RigPose near =
        judge_rig(views, matches, motion, options, wider * options.inlier_px, slack);
    if (near.inliers.size() < 4) return {};
    motion = refine_rig(near.terms, views, motion, wider > 1 ? 5 : 10);
  }
  return judge_rig(views, matches, motion, options, options.inlier_px);
}

// The plane through points of one view: its frame in the object, and how flat they are.
struct Plane {
  Rigid3 object_from_plane;
  double flatness = 1;
};
Plane plane_of(const std::vector<PointMatch>& matches) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const PointMatch& match : matches) middle += match.point_in_object;
  middle /= static_cast<double>(matches.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const PointMatch& match : matches) {
    const Eigen::Vector3d from_middle = match.point_in_object - middle;
    spread += from_middle * from_middle.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
  Eigen::Matrix3d axes;
  axes << principal.eigenvectors().col(2), principal.eigenvectors().col(1),
      principal.eigenvectors().col(2).cross(principal.eigenvectors().col(1));
  const Eigen::Vector3d widths = principal.eigenvalues().cwiseMax(0).cwiseSqrt();
  return {Rigid3(Eigen::Quaterniond(axes), middle), widths[0] / std::max(widths[1], 1e-9)};
}

// Most of what is seen may be flat though not all is: the side of a box. Leaves the flattest ones.
std::vector<PointMatch> flat_part(std::vector<PointMatch> matches) {
  for (int round = 0; round < 3 && matches.size() > 2 * kMinForPlane; ++round) {
    const Plane plane = plane_of(matches);
    if (plane.flatness < kFlat / 4) break;
    const Eigen::Vector3d normal = plane.object_from_plane.rotation_matrix().col(2);
    const auto height = [&](const PointMatch& match) {
      return std::abs(normal.dot(match.point_in_object - plane.object_from_plane.translation));
    };
    std::stable_sort(matches.begin(), matches.end(), [&](const PointMatch& a, const PointMatch& b) {
      return height(a) < height(b);
    });
    matches.resize(matches.size() * 4 / 5);
  }
  return matches;
}

// Both poses of every view whose supporting points are flat.
std::vector<RigMotion> flipped_motions(std::span<const RigView> views, const RigPose& pose) {
  std::vector<RigMotion> out;
  for (size_t i = 0; i < views.size(); ++i) {
    const auto* term = dynamic_cast<const ReprojectionTerm*>(pose.terms[i].get());
    if (term == nullptr || term->matches().size() < kMinForPlane) continue;
    const std::vector<PointMatch> matches = flat_part(term->matches());
    const Plane plane = plane_of(matches);
    if (plane.flatness > kFlat) continue;
    PlanarView view;
    view.object_from_plane = plane.object_from_plane;
    const Rigid3 plane_from_object = plane.object_from_plane.inverse();
    for (const PointMatch& match : matches) {
      view.points.push_back((plane_from_object * match.point_in_object).head<2>());
      view.pixels.push_back(match.pixel);
    }
    const CalibratedCamera& camera = *views[i].camera;
    for (const Rigid3& camera_from_plane : plane_poses(camera.model, view)) {
      const Rigid3 here = camera.world_from_camera * camera_from_plane * plane_from_object;
      RigMotion flipped{here * Rigid3::exp(-pose.motion.twist * views[i].seconds),
                        pose.motion.twist};
      out.push_back(flipped);
    }
  }
  return out;
}

// Squared error of a match by that of the least one that does not support the pose, at most 1.
class Errors {
 public:
  // `slack` [m/s] widens it for images of other times.
  Errors(std::span<const RigView> views, const RigMotion& motion, const PatchTolerance& patch,
         double inlier_px, double slack)
      : views_(views), patch_(patch) {
    for (const RigView& view : views) {
      const double distance =
          (motion.world_from_object.translation - view.camera->world_from_camera.translation)
              .norm();
      inlier_px_.push_back(inlier_px + slack * std::abs(view.seconds) *
                                           view.camera->model.parameters().fx /
                                           std::max(distance, 0.01));
      camera_from_object_.push_back(view.camera->world_from_camera.inverse() *
                                    motion.at(view.seconds));
      rotations_.push_back(camera_from_object_.back().rotation_matrix());
    }
  }
  double operator()(const RigMatch& m) const {
    const Eigen::Vector3d point = camera_from_object_[m.view] * m.match.point_in_object;
    if (!looks_like(m.trained, rotations_[m.view], point, m.seen, patch_)) return 1;
    const auto pixel = views_[m.view].camera->model.project(point);
    if (!pixel) return 1;
    return std::min(
        1.0, (*pixel - m.match.pixel).squaredNorm() / (inlier_px_[m.view] * inlier_px_[m.view]));
  }

 private:
  std::span<const RigView> views_;
  const PatchTolerance& patch_;
  std::vector<double> inlier_px_;  // by view
  std::vector<Rigid3> camera_from_object_;
  std::vector<Eigen::Matrix3d> rotations_;
};

void add_new(RigPose pose, std::vector<RigPose>& out) {
  if (pose.inliers.empty()) return;
  for (RigPose& known : out) {
    if (!same_motion(known.motion, pose.motion)) continue;
    if (pose.support > known.support) known = std::move(pose);
    return;
  }
  out.push_back(std::move(pose));
}

}  // namespace

MotionSystem linearize_rig(std::span<const PoseTermPtr> terms, std::span<const RigView> views,
                           const RigMotion& motion) {
  MotionSystem out(motion.twist);
  for (size_t i = 0; i < views.size(); ++i) {
    if (terms[i] == nullptr) continue;
    const double seconds = views[i].seconds;
    out.add(terms[i]->linearize(motion.at(seconds)), motion_jacobian(motion.twist, seconds));
  }
  return out;
}

RigMotion refine_rig(std::span<const PoseTermPtr> terms, std::span<const RigView> views,
                     const RigMotion& start, int max_steps) {
  const bool twist_fixed = simultaneous(views);
  RigMotion best = start;
  MotionSystem at = linearize_rig(terms, views, best);
  double damping = 1e-4;
  for (int step = 0; step < max_steps; ++step) {
    Matrix12 system = at.information;
    system.diagonal() *= 1 + damping;
    system.diagonal().array() += 1e-9;
    Vector12 move = Vector12::Zero();
    if (twist_fixed) {
      move.head<6>() = -system.topLeftCorner<6, 6>().ldlt().solve(at.gradient.head<6>());
    } else {
      move = -system.ldlt().solve(at.gradient);
    }
    if (!move.allFinite()) break;
    const RigMotion next{best.world_from_object * Rigid3::exp(move.head<6>()),
                         best.twist + move.tail<6>()};
    const MotionSystem there = linearize_rig(terms, views, next);
    if (there.cost > at.cost) {
      damping *= 10;
      if (damping > 1e6) break;
      continue;
    }
    const bool settled = at.cost - there.cost < 1e-5 * (1e-3 + at.cost);
    best = next;
    at = there;
    damping = std::max(1e-9, damping * 0.1);
    if (settled) break;
  }
  return best;
}

std::optional<double> flat_tilt(std::span<const RigView> views, const RigPose& pose, size_t view) {
  const auto* term = dynamic_cast<const ReprojectionTerm*>(pose.terms[view].get());
  if (term == nullptr || term->matches().size() < kMinForPlane) return std::nullopt;
  const Plane plane = plane_of(flat_part(term->matches()));
  if (plane.flatness > kFlat) return std::nullopt;
  const Rigid3 camera_from_plane = views[view].camera->world_from_camera.inverse() *
                                   pose.motion.at(views[view].seconds) * plane.object_from_plane;
  const Eigen::Vector3d normal = camera_from_plane.rotation_matrix().col(2);
  const Eigen::Vector3d sight = camera_from_plane.translation.normalized();
  return std::acos(std::min(1.0, std::abs(normal.dot(sight))));
}

RigPose judge_rig(std::span<const RigView> views, std::span<const RigMatch> matches,
                  const RigMotion& motion, const RigPoseOptions& options, double inlier_px,
                  double slack) {
  RigPose out;
  out.motion = motion;
  const Errors errors(views, motion, options.patch, inlier_px, slack);
  std::vector<std::vector<PointMatch>> agreeing(views.size());
  for (size_t i = 0; i < matches.size(); ++i) {
    const double error = errors(matches[i]);
    if (!(error < 1)) continue;
    out.support += 1 - error;
    out.inliers.push_back(i);
    agreeing[matches[i].view].push_back(matches[i].match);
  }
  for (size_t i = 0; i < views.size(); ++i) {
    out.terms.push_back(agreeing[i].empty() ? nullptr
                                            : std::make_shared<const ReprojectionTerm>(
                                                  views[i].camera, std::move(agreeing[i]),
                                                  options.huber, options.view_error, "detection"));
  }
  return out;
}

std::vector<RigPose> solve_rig(std::span<const RigView> views, std::span<const RigMatch> matches,
                               const RigPoseOptions& options) {
  std::vector<RigPose> out;
  for (const Rigid3& start : ray_poses(views, matches, options)) {
    add_new(fitted(views, matches, {start}, options), out);
  }
  const size_t found = out.size();
  for (size_t i = 0; i < found; ++i) {
    for (const RigMotion& flipped : flipped_motions(views, out[i])) {
      add_new(fitted(views, matches, flipped, options), out);
    }
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const RigPose& a, const RigPose& b) { return a.support > b.support; });
  std::erase_if(out, [&](const RigPose& pose) {
    return pose.support < kMinSupportShare * out.front().support;
  });
  return out;
}

}  // namespace sightline::observe
