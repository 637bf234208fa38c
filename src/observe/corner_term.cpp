// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/corner_term.hpp"

#include <cmath>
#include <utility>

namespace sightline {

CornerTerm::CornerTerm(std::shared_ptr<const CalibratedCamera> camera,
                       std::vector<PointMatch> matches, double huber)
    : camera_(std::move(camera)),
      camera_from_world_(camera_->world_from_camera.inverse()),
      matches_(std::move(matches)),
      huber_(huber) {}

LinearizedTerm CornerTerm::linearize(const Rigid3& world_from_object) const {
  const Rigid3 camera_from_object = camera_from_world_ * world_from_object;
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  LinearizedTerm out;
  double weights = 0;
  for (const PointMatch& match : matches_) {
    const Eigen::Vector3d point = rotation * match.point_in_object + camera_from_object.translation;
    Eigen::Matrix<double, 2, 3> pixel_by_point;
    const auto pixel = camera_->model.project(point, &pixel_by_point);
    out.residuals += 2;
    if (!pixel) {
      out.cost += huber_ * (kUnseenError - huber_ / 2);
      continue;
    }
    const Eigen::Vector2d residual = (*pixel - match.pixel) / match.sigma_px;
    const double error = residual.norm();
    const double weight = error <= huber_ ? 1.0 : huber_ / error;
    out.cost += error <= huber_ ? error * error / 2 : huber_ * (error - huber_ / 2);
    weights += weight;

    // x = R (X + omega x X + v) + t: the perturbation acts on the object's side.
    const Eigen::Matrix<double, 2, 3> pixel_by_object = pixel_by_point * rotation / match.sigma_px;
    Eigen::Matrix<double, 2, 6> jacobian;
    jacobian.leftCols<3>() = -pixel_by_object * skew(match.point_in_object);
    jacobian.rightCols<3>() = pixel_by_object;
    out.information.noalias() += weight * jacobian.transpose() * jacobian;
    out.gradient.noalias() += weight * jacobian.transpose() * residual;
  }
  if (!matches_.empty()) out.quality = weights / static_cast<double>(matches_.size());
  return out;
}

}  // namespace sightline
