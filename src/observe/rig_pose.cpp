// SPDX-License-Identifier: Apache-2.0
#include "rig_pose.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "plane_pose.hpp"
#include "ray_pose.hpp"

namespace sightline::observe {
namespace {

constexpr double kTwistAngular = 3.5, kTwistLinear = 1.0;  // one sigma of the prior
constexpr double kTogether = 1e-3;                         // [s]
constexpr size_t kLeastForPlane = 6;
constexpr double kFlat = 0.2;   // thickness of a plane's points by their width
constexpr double kAlike = 0.5;  // share of the best support that another pose needs

Vector6 twist_prior() {
  Vector6 prior;
  prior << Eigen::Vector3d::Constant(1 / (kTwistAngular * kTwistAngular)),
      Eigen::Vector3d::Constant(1 / (kTwistLinear * kTwistLinear));
  return prior;
}

bool together(std::span<const RigView> views) {
  return std::all_of(views.begin(), views.end(),
                     [](const RigView& view) { return std::abs(view.seconds) < kTogether; });
}

bool alike(const RigMotion& a, const RigMotion& b) {
  const Vector6 d = difference(a.world_from_object, b.world_from_object);
  return d.head<3>().norm() < 0.05 && d.tail<3>().norm() < 0.01;
}

// From a wide neighbourhood to the close one, matches chosen anew each time.
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
  for (int round = 0; round < 3 && matches.size() > 2 * kLeastForPlane; ++round) {
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
std::vector<RigMotion> flips_of(std::span<const RigView> views, const RigPose& pose) {
  std::vector<RigMotion> out;
  for (size_t i = 0; i < views.size(); ++i) {
    const auto* term = dynamic_cast<const CornerTerm*>(pose.terms[i].get());
    if (term == nullptr || term->matches().size() < kLeastForPlane) continue;
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
  // `slack` [m/s] widens it for pictures of other times.
  Errors(std::span<const RigView> views, const RigMotion& motion, double facing, double inlier_px,
         double slack)
      : views_(views), facing_(facing) {
    for (const RigView& view : views) {
      const double distance =
          (motion.world_from_object.translation - view.camera->world_from_camera.translation)
              .norm();
      inlier_px_.push_back(inlier_px + slack * std::abs(view.seconds) *
                                           view.camera->model.parameters().fx /
                                           std::max(distance, 0.01));
      camera_from_object_.push_back(view.camera->world_from_camera.inverse() *
                                    motion.at(view.seconds));
      eyes_.push_back(camera_from_object_.back().inverse().translation);
    }
  }
  double operator()(const RigMatch& m) const {
    const Eigen::Vector3d sight = (eyes_[m.view] - m.match.point_in_object).normalized();
    if (sight.dot(m.seen_from) < facing_) return 1;
    const auto pixel =
        views_[m.view].camera->model.project(camera_from_object_[m.view] * m.match.point_in_object);
    if (!pixel) return 1;
    return std::min(
        1.0, (*pixel - m.match.pixel).squaredNorm() / (inlier_px_[m.view] * inlier_px_[m.view]));
  }

 private:
  std::span<const RigView> views_;
  double facing_;
  std::vector<double> inlier_px_;  // by view
  std::vector<Rigid3> camera_from_object_;
  std::vector<Eigen::Vector3d> eyes_;  // in the object
};

void add_new(RigPose pose, std::vector<RigPose>& out) {
  if (pose.inliers.empty()) return;
  for (RigPose& known : out) {
    if (!alike(known.motion, pose.motion)) continue;
    if (pose.support > known.support) known = std::move(pose);
    return;
  }
  out.push_back(std::move(pose));
}

}  // namespace

double twist_cost(const Vector6& twist) {
  return 0.5 * twist.dot(twist_prior().cwiseProduct(twist));
}

RigSystem linearize_rig(std::span<const PoseTermPtr> terms, std::span<const RigView> views,
                        const RigMotion& motion) {
  RigSystem out;
  const Vector6 prior = twist_prior();
  out.information.diagonal().tail<6>() = prior;
  out.gradient.tail<6>() = prior.cwiseProduct(motion.twist);
  out.cost = twist_cost(motion.twist);
  for (size_t i = 0; i < views.size(); ++i) {
    if (terms[i] == nullptr) continue;
    const double s = views[i].seconds;
    const LinearizedTerm term = terms[i]->linearize(motion.at(s));
    Eigen::Matrix<double, 6, 12> by_motion;
    by_motion << Rigid3::exp(-motion.twist * s).adjoint(), s * right_jacobian(motion.twist * s);
    out.information += by_motion.transpose() * term.information * by_motion;
    out.gradient += by_motion.transpose() * term.gradient;
    out.cost += term.cost;
  }
  return out;
}

RigMotion refine_rig(std::span<const PoseTermPtr> terms, std::span<const RigView> views,
                     const RigMotion& start, int max_steps) {
  const bool still = together(views);
  RigMotion best = start;
  RigSystem at = linearize_rig(terms, views, best);
  double damping = 1e-4;
  for (int step = 0; step < max_steps; ++step) {
    Matrix12 system = at.information;
    system.diagonal() *= 1 + damping;
    system.diagonal().array() += 1e-9;
    Vector12 move = Vector12::Zero();
    if (still) {
      move.head<6>() = -system.topLeftCorner<6, 6>().ldlt().solve(at.gradient.head<6>());
    } else {
      move = -system.ldlt().solve(at.gradient);
    }
    if (!move.allFinite()) break;
    const RigMotion next{best.world_from_object * Rigid3::exp(move.head<6>()),
                         best.twist + move.tail<6>()};
    const RigSystem there = linearize_rig(terms, views, next);
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
  const auto* term = dynamic_cast<const CornerTerm*>(pose.terms[view].get());
  if (term == nullptr || term->matches().size() < kLeastForPlane) return std::nullopt;
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
  const Errors errors(views, motion, options.facing, inlier_px, slack);
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
                                            : std::make_shared<const CornerTerm>(
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
    for (const RigMotion& flipped : flips_of(views, out[i])) {
      add_new(fitted(views, matches, flipped, options), out);
    }
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const RigPose& a, const RigPose& b) { return a.support > b.support; });
  std::erase_if(out,
                [&](const RigPose& pose) { return pose.support < kAlike * out.front().support; });
  return out;
}

}  // namespace sightline::observe
