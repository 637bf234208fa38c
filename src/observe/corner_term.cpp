// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/corner_term.hpp"

#include <Eigen/Cholesky>
#include <utility>

namespace sightline {

namespace {

using Matrix26 = Eigen::Matrix<double, 2, 6>;

}  // namespace

/// One match at a pose, everything divided by its sigma: what is off, how that changes with the
/// pose's tangent, and with the view's own error (b_x, b_y, A's columns).
struct CornerTerm::Seen {
  Eigen::Vector2d residual;
  Matrix26 by_pose;
  Matrix26 by_view;
};

CornerTerm::CornerTerm(std::shared_ptr<const CalibratedCamera> camera,
                       std::vector<PointMatch> matches, double huber, const ViewError& view_error,
                       std::string_view kind)
    : camera_(std::move(camera)),
      camera_from_world_(camera_->world_from_camera.inverse()),
      matches_(std::move(matches)),
      huber_(huber),
      view_error_(view_error),
      kind_(kind),
      middle_(Eigen::Vector2d::Zero()) {
  for (const PointMatch& match : matches_) {
    middle_ += match.pixel / static_cast<double>(matches_.size());
  }
}

/// Normal equations of the view's own error with the weights at `view`. An error that is not
/// allowed for is pinned to zero.
Matrix6 CornerTerm::view_system(const std::vector<Seen>& seen, const Vector6& view,
                                Vector6& right) const {
  constexpr double kPinned = 1e12;
  const auto prior = [](double sigma) { return sigma > 0 ? 1 / (sigma * sigma) : kPinned; };
  Matrix6 system = Matrix6::Zero();
  system.diagonal().head<2>().setConstant(prior(view_error_.shift_px));
  system.diagonal().tail<4>().setConstant(prior(view_error_.stretch));
  right.setZero();
  for (const Seen& s : seen) {
    const double w = weight((s.residual - s.by_view * view).norm());
    system.noalias() += w * s.by_view.transpose() * s.by_view;
    right.noalias() += w * s.by_view.transpose() * s.residual;
  }
  return system;
}

/// The view's error at the minimum, by iteratively re-weighted least squares.
Vector6 CornerTerm::fit_view(const std::vector<Seen>& seen) const {
  constexpr int kMaxRounds = 100;  // a handful, unless points contradict each other
  Vector6 view = Vector6::Zero();
  for (int round = 0; round < kMaxRounds; ++round) {
    Vector6 right;
    const Matrix6 system = view_system(seen, view, right);
    const Vector6 next = system.ldlt().solve(right);
    const bool settled = (next - view).squaredNorm() < 1e-16;
    view = next;
    if (settled) break;
  }
  return view;
}

LinearizedTerm CornerTerm::linearize(const Rigid3& world_from_object) const {
  const Rigid3 camera_from_object = camera_from_world_ * world_from_object;
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  LinearizedTerm out;
  std::vector<Seen> seen;
  seen.reserve(matches_.size());
  for (const PointMatch& match : matches_) {
    const Eigen::Vector3d point = rotation * match.point_in_object + camera_from_object.translation;
    Eigen::Matrix<double, 2, 3> pixel_by_point;
    const auto pixel = camera_->model.project(point, &pixel_by_point);
    out.residuals += 2;
    if (!pixel) {
      out.cost += huber_ * (kUnseenError - huber_ / 2);
      continue;
    }
    // x = R (X + omega x X + v) + t: the perturbation acts on the object's side.
    const Eigen::Matrix<double, 2, 3> by_object = pixel_by_point * rotation / match.sigma_px;
    const Eigen::Vector2d u = (match.pixel - middle_) / match.sigma_px;
    Seen s;
    s.residual = (*pixel - match.pixel) / match.sigma_px;
    s.by_pose << -by_object * skew(match.point_in_object), by_object;
    s.by_view << Eigen::Matrix2d::Identity() / match.sigma_px, u.x() * Eigen::Matrix2d::Identity(),
        u.y() * Eigen::Matrix2d::Identity();
    seen.push_back(s);
  }

  const bool view_errs = view_error_.shift_px > 0 || view_error_.stretch > 0;
  const Vector6 view = view_errs ? fit_view(seen) : Vector6::Zero();
  Matrix6 pose_by_view = Matrix6::Zero();
  double inliers = 0;
  for (const Seen& s : seen) {
    const Eigen::Vector2d residual = s.residual - s.by_view * view;
    const double error = residual.norm();
    const double w = weight(error);
    out.cost += error <= huber_ ? error * error / 2 : huber_ * (error - huber_ / 2);
    inliers += w;
    out.information.noalias() += w * s.by_pose.transpose() * s.by_pose;
    out.gradient.noalias() += w * s.by_pose.transpose() * residual;
    pose_by_view.noalias() += w * s.by_pose.transpose() * s.by_view;
  }
  if (view_errs) {
    Vector6 right;
    const Matrix6 system = view_system(seen, view, right);
    if (view_error_.shift_px > 0) {
      out.cost += view.head<2>().squaredNorm() / (2 * view_error_.shift_px * view_error_.shift_px);
    }
    if (view_error_.stretch > 0) {
      out.cost += view.tail<4>().squaredNorm() / (2 * view_error_.stretch * view_error_.stretch);
    }
    out.information.noalias() -= pose_by_view * system.ldlt().solve(pose_by_view.transpose());
    out.information = ((out.information + out.information.transpose()) / 2).eval();
  }
  if (!matches_.empty()) out.quality = inliers / static_cast<double>(matches_.size());
  return out;
}

}  // namespace sightline
