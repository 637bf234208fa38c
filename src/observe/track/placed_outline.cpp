// SPDX-License-Identifier: Apache-2.0
#include "observe/track/placed_outline.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "observe/track/track_constants.hpp"
#include "sightline/geometry/rolling_shutter.hpp"

namespace sightline::observe {
namespace {

Matrix6 information_of(const Matrix6& covariance, double min_rotation, double min_translation) {
  Matrix6 wider = covariance;
  wider.diagonal().head<3>().array() += min_rotation * min_rotation;
  wider.diagonal().tail<3>().array() += min_translation * min_translation;
  return wider.ldlt().solve(Matrix6::Identity());
}

}  // namespace

PosePrior::PosePrior(const Rigid3& pose, const Matrix6& covariance, double min_rotation,
                     double min_translation)
    : world_from_object(pose),
      information(information_of(covariance, min_rotation, min_translation)) {}

void PlacedOutline::place(const Rigid3& world_from_object) {
  world_from_object_ = world_from_object;
  const Rigid3 camera_from_object = camera_->camera_from_world * world_from_object;
  view_ = views_->nearest(camera_from_object);
  place_lines(views_->view(view_), camera_->camera->model, camera_from_object, occluders_,
              tuning::kBorderPx, revolved(), lines_);
}

void PlacedOutline::set_motion(const Rigid3& world_from_object, const Vector6& twist) {
  twist_ = twist;
  center_delay_s_ = row_delay_s(
      *camera_->camera, camera_->camera_from_world * (world_from_object * views_->center()));
}

double PlacedOutline::rolled_px(const Vector6& by_pose, double row) const {
  return (row_delay_s(*camera_->camera, row) - center_delay_s_) * by_pose.dot(twist_);
}

void PlacedOutline::correct_for_rolling() {
  if (!rolling()) return;
  for (ContourLine& line : lines_) {
    if (line.measured) line.mean -= rolled_px(line.by_pose, line.center.y());
  }
}

double PlacedOutline::pixels_per_meter() const {
  const Eigen::Vector3d center = camera_from_object() * views_->center();
  return camera_->camera->model.parameters().fx / std::max(center.norm(), 1e-3);
}

double PlacedOutline::independent_share(double correlation_px) const {
  const View view = views_->view(view_);
  const double spacing = static_cast<double>(view.contour_length) * pixels_per_meter() /
                         std::max(1.0, static_cast<double>(view.contour.size()));
  return std::clamp(spacing / correlation_px, 0.02, 1.0);
}

Eigen::AlignedBox2d PlacedOutline::bounds() const {
  Eigen::AlignedBox2d box;
  for (const ContourLine& line : lines_) box.extend(line.center);
  return box;
}

double PlacedOutline::distance_to(const Rigid3& world_from_object) const {
  const Vector6 off = difference(world_from_object_, world_from_object);
  double squares = 0;
  for (const ContourLine& line : lines_) squares += std::pow(line.by_pose.dot(off), 2);
  return std::sqrt(squares / std::max<double>(1, static_cast<double>(lines_.size())));
}

}  // namespace sightline::observe
