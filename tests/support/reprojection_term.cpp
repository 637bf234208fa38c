// SPDX-License-Identifier: Apache-2.0
#include "support/reprojection_term.hpp"

#include <Eigen/Cholesky>

namespace sightline::test {

LinearizedTerm ReprojectionTerm::linearize(const Rigid3& world_from_object) const {
  LinearizedTerm sum;
  const Rigid3 camera_from_object = camera_.world_from_camera.inverse() * world_from_object;
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  const double weight = 1.0 / (sigma_px_ * sigma_px_);
  for (const PointMatch& match : matches_) {
    Eigen::Matrix<double, 2, 3> by_point;
    const auto pixel = camera_.model.project(camera_from_object * match.point_in_object, &by_point);
    if (!pixel) return {};
    // camera_from_object * exp(d) * p  ~  ... + R (d_t + d_r x p)
    Eigen::Matrix<double, 2, 6> by_pose;
    by_pose.leftCols<3>() = -by_point * rotation * skew(match.point_in_object);
    by_pose.rightCols<3>() = by_point * rotation;
    const Eigen::Vector2d residual = *pixel - match.pixel;
    sum.information += weight * by_pose.transpose() * by_pose;
    sum.gradient += weight * by_pose.transpose() * residual;
    sum.cost += 0.5 * weight * residual.squaredNorm();
    sum.residuals += 2;
  }
  sum.quality = 1.0;
  return sum;
}

Rigid3 minimize(const PoseTerm& term, const Rigid3& start, double* cost) {
  Rigid3 pose = start;
  LinearizedTerm at = term.linearize(pose);
  double damping = 1e-3;
  for (int i = 0; i < 60 && damping < 1e9; ++i) {
    Matrix6 damped = at.information;
    damped.diagonal() *= 1.0 + damping;
    const Vector6 step = -damped.ldlt().solve(at.gradient);
    const Rigid3 trial = pose * Rigid3::exp(step);
    const LinearizedTerm there = term.linearize(trial);
    if (there.residuals == 0 || there.cost > at.cost) {
      damping *= 10;
      continue;
    }
    const double gain = at.cost - there.cost;
    pose = trial;
    at = there;
    damping = std::max(1e-12, damping * 0.1);
    if (gain < 1e-10) break;
  }
  *cost = at.cost;
  return pose;
}

}  // namespace sightline::test
