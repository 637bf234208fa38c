// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/terms/reprojection_term.hpp"

#include <utility>

#include "observe/terms/robust_loss.hpp"
#include "observe/terms/shared_error.hpp"

namespace sightline {

using observe::HuberLoss;
using observe::prior_information;

/// One match at a pose, everything divided by its sigma: what is off, how that changes with the
/// pose's tangent, and with the view's own error (b_x, b_y, A's columns).
struct ReprojectionTerm::Residual {
  using Matrix26 = Eigen::Matrix<double, 2, 6>;

  Eigen::Vector2d value;
  Matrix26 by_pose;
  Matrix26 by_view;

  Eigen::Vector2d less(const Vector6& view) const { return value - by_view * view; }
  double error(const Vector6& view) const { return less(view).norm(); }
  void add_shared(double weight, Matrix6& information, Vector6& right) const {
    information.noalias() += weight * by_view.transpose() * by_view;
    right.noalias() += weight * by_view.transpose() * value;
  }
};

ReprojectionTerm::ReprojectionTerm(std::shared_ptr<const CalibratedCamera> camera,
                                   std::vector<PointMatch> matches, double huber,
                                   const ViewError& view_error, std::string_view kind)
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

/// Residuals of the matches that project; the others add to the cost of `out`.
std::vector<ReprojectionTerm::Residual> ReprojectionTerm::project(const Rigid3& world_from_object,
                                                                  LinearizedTerm& out) const {
  const Rigid3 camera_from_object = camera_from_world_ * world_from_object;
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  const double unseen = HuberLoss(huber_).cost(kUnseenError);
  std::vector<Residual> residuals;
  residuals.reserve(matches_.size());
  for (const PointMatch& match : matches_) {
    const Eigen::Vector3d point = rotation * match.point_in_object + camera_from_object.translation;
    Eigen::Matrix<double, 2, 3> pixel_by_point;
    const auto pixel = camera_->model.project(point, &pixel_by_point);
    out.residuals += 2;
    if (!pixel) {
      out.cost += unseen;
      continue;
    }
    // x = R (X + omega x X + v) + t: the perturbation acts on the object's side.
    const Eigen::Matrix<double, 2, 3> by_object = pixel_by_point * rotation / match.sigma_px;
    const Eigen::Vector2d u = (match.pixel - middle_) / match.sigma_px;
    Residual r;
    r.value = (*pixel - match.pixel) / match.sigma_px;
    r.by_pose << -by_object * skew(match.point_in_object), by_object;
    r.by_view << Eigen::Matrix2d::Identity() / match.sigma_px, u.x() * Eigen::Matrix2d::Identity(),
        u.y() * Eigen::Matrix2d::Identity();
    residuals.push_back(r);
  }
  return residuals;
}

LinearizedTerm ReprojectionTerm::linearize(const Rigid3& world_from_object) const {
  constexpr int kMaxRounds = 100;  // a handful, unless points contradict each other
  LinearizedTerm out;
  const std::vector<Residual> residuals = project(world_from_object, out);
  const HuberLoss loss(huber_);
  const bool view_errs = view_error_.shift_px > 0 || view_error_.stretch > 0;
  Vector6 prior;
  prior.head<2>().setConstant(prior_information(view_error_.shift_px));
  prior.tail<4>().setConstant(prior_information(view_error_.stretch));
  observe::SharedError<6> shared;
  if (view_errs) shared.minimize(residuals, prior, loss, kMaxRounds, 1e-16);
  const Vector6 view = shared.value;

  Matrix6 pose_by_view = Matrix6::Zero();
  double inliers = 0;
  for (const Residual& r : residuals) {
    const Eigen::Vector2d residual = r.less(view);
    const double error = residual.norm();
    const double w = loss.weight(error);
    out.cost += loss.cost(error);
    inliers += w;
    out.information.noalias() += w * r.by_pose.transpose() * r.by_pose;
    out.gradient.noalias() += w * r.by_pose.transpose() * residual;
    pose_by_view.noalias() += w * r.by_pose.transpose() * r.by_view;
  }
  if (view_errs) {
    if (view_error_.shift_px > 0) {
      out.cost += view.head<2>().squaredNorm() / (2 * view_error_.shift_px * view_error_.shift_px);
    }
    if (view_error_.stretch > 0) {
      out.cost += view.tail<4>().squaredNorm() / (2 * view_error_.stretch * view_error_.stretch);
    }
    shared.linearize(residuals, prior, loss);  // with the weights at the minimum
    shared.eliminate(pose_by_view, out);
  }
  if (!matches_.empty()) out.quality = inliers / static_cast<double>(matches_.size());
  return out;
}

}  // namespace sightline
