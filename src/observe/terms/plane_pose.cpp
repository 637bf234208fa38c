// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/plane_pose.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace sightline::observe {
namespace {

Rigid3 to_rigid(const cv::Mat& rotation_vector, const cv::Mat& translation) {
  cv::Matx33d r;
  cv::Rodrigues(rotation_vector, r);
  Eigen::Matrix3d rotation;
  rotation << r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2);
  return Rigid3(Eigen::Quaterniond(rotation),
                {translation.at<double>(0), translation.at<double>(1), translation.at<double>(2)});
}

bool same_pose(const Rigid3& a, const Rigid3& b) {
  const Vector6 d = difference(a, b);
  return d.head<3>().norm() < 0.02 && d.tail<3>().norm() < 0.02 * (0.1 + b.translation.norm());
}

}  // namespace

std::vector<Rigid3> plane_poses(const CameraModel& camera, const PlanarView& view) {
  std::vector<cv::Point3d> object;
  std::vector<cv::Point2d> image;
  for (size_t i = 0; i < view.points.size(); ++i) {
    const auto ray = camera.unproject(view.pixels[i]);
    if (!ray || ray->z() < 0.05) continue;
    object.emplace_back(view.points[i].x(), view.points[i].y(), 0.0);
    image.emplace_back(ray->x() / ray->z(), ray->y() / ray->z());
  }
  std::vector<Rigid3> poses;
  if (object.size() < 4) return poses;
  try {
    std::vector<cv::Mat> rotations, translations;
    cv::solvePnPGeneric(object, image, cv::Matx33d::eye(), cv::noArray(), rotations, translations,
                        false, cv::SOLVEPNP_IPPE);
    for (size_t i = 0; i < rotations.size(); ++i) {
      const Rigid3 pose = to_rigid(rotations[i], translations[i]);
      if (pose.translation.allFinite() && pose.rotation.coeffs().allFinite()) poses.push_back(pose);
    }
  } catch (const cv::Exception&) {
    poses.clear();  // points on one line
  }
  return poses;
}

PoseHypothesis refine_pose(const PoseTerm& term, const Rigid3& start, int max_steps) {
  PoseHypothesis best{start, 0};
  LinearizedTerm at = term.linearize(start);
  best.cost = at.cost;
  double damping = 1e-4;
  for (int step = 0; step < max_steps; ++step) {
    Matrix6 system = at.information;
    system.diagonal() *= 1 + damping;
    system.diagonal().array() += 1e-9;
    const Vector6 move = -system.ldlt().solve(at.gradient);
    if (!move.allFinite()) break;
    const Rigid3 candidate = best.world_from_object * Rigid3::exp(move);
    const LinearizedTerm next = term.linearize(candidate);
    if (next.cost > at.cost) {
      damping *= 10;
      if (damping > 1e6) break;
      continue;
    }
    const bool settled = at.cost - next.cost < 1e-6 * (1e-3 + at.cost);
    best = {candidate, next.cost};
    at = next;
    damping = std::max(1e-9, damping * 0.1);
    if (settled) break;
  }
  return best;
}

std::vector<PoseHypothesis> pose_hypotheses(const ReprojectionTerm& term,
                                            const std::vector<PlanarView>& views, double margin) {
  std::vector<PoseHypothesis> found;
  const CalibratedCamera& camera = term.camera();
  for (const PlanarView& view : views) {
    for (const Rigid3& camera_from_plane : plane_poses(camera.model, view)) {
      const Rigid3 start =
          camera.world_from_camera * camera_from_plane * view.object_from_plane.inverse();
      const PoseHypothesis refined = refine_pose(term, start);
      const bool known = std::any_of(found.begin(), found.end(), [&](const PoseHypothesis& h) {
        return same_pose(h.world_from_object, refined.world_from_object);
      });
      if (!known) found.push_back(refined);
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.cost < b.cost; });
  std::erase_if(found, [&](const auto& h) { return h.cost > found.front().cost + margin; });
  if (found.size() > 2) found.resize(2);
  return found;
}

}  // namespace sightline::observe
