// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/terms/line_term.hpp"

#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "observe/terms/line_jacobian.hpp"
#include "observe/terms/robust_loss.hpp"
#include "observe/terms/shared_error.hpp"

namespace sightline {

using observe::HuberLoss;
using observe::kPinned;
using observe::prior_information;

/// One line at a pose, everything divided by its sigma.
struct LineTerm::Residual {
  using Shared = Eigen::Vector3d;  // (b_x, b_y, o)

  Vector6 by_pose;
  Shared by_shared;
  double value;

  double less(const Shared& shared) const { return value - by_shared.dot(shared); }
  double error(const Shared& shared) const { return std::abs(less(shared)); }
  void add_shared(double weight, Eigen::Matrix3d& information, Shared& right) const {
    const Shared weighted = weight * by_shared;
    information.noalias() += weighted * by_shared.transpose();
    right += weighted * value;
  }
};

LineTerm::LineTerm(std::string_view kind, std::shared_ptr<const CalibratedCamera> camera,
                   std::vector<LineMatch> lines, double huber, const LineError& error,
                   double independent_share)
    : kind_(kind),
      camera_(std::move(camera)),
      camera_from_world_(camera_->world_from_camera.inverse()),
      lines_(std::move(lines)),
      huber_(huber),
      error_(error),
      share_(independent_share) {}

/// Residuals of the lines that project, into `out`; the number of them. The others add to `cost`.
size_t LineTerm::project(const Rigid3& world_from_object, Residual* out, double& cost) const {
  const observe::LineProjector projector(camera_->model, camera_from_world_ * world_from_object);
  const double unseen = HuberLoss(huber_).cost(kUnseenError);
  size_t count = 0;
  for (const LineMatch& line : lines_) {
    double distance = 0;
    Residual& r = out[count];
    if (!projector.distance(line.point_in_object, line.center, line.normal, distance, r.by_pose)) {
      cost += unseen;
      continue;
    }
    double nearest = distance - static_cast<double>(line.offset[0]);
    for (int k = 1; k < line.offsets; ++k) {
      const double other = distance - static_cast<double>(line.offset[static_cast<size_t>(k)]);
      if (std::abs(other) < std::abs(nearest)) nearest = other;
    }
    const double scale = 1 / line.sigma_px;
    r.by_pose *= scale;
    r.value = nearest * scale;
    r.by_shared = Eigen::Vector3d(line.normal.x(), line.normal.y(), 1.0) * scale;
    ++count;
  }
  return count;
}

LinearizedTerm LineTerm::linearize(const Rigid3& world_from_object) const {
  constexpr size_t kMaxOnStack = 512;
  std::array<Residual, kMaxOnStack> on_stack;
  std::vector<Residual> on_heap;
  if (lines_.size() > kMaxOnStack) on_heap.resize(lines_.size());
  Residual* const storage = on_heap.empty() ? on_stack.data() : on_heap.data();
  LinearizedTerm out;
  const std::span<const Residual> residuals(storage, project(world_from_object, storage, out.cost));

  // The priors of the errors that all share do not get stronger with fewer independent lines.
  constexpr int kMaxRounds = 30;
  const HuberLoss loss(huber_);
  const bool shared_errs = error_.shift_px > 0 || error_.dilate_px > 0;
  const Eigen::Vector3d prior(prior_information(error_.shift_px) / share_,
                              prior_information(error_.shift_px) / share_,
                              prior_information(error_.dilate_px) / share_);
  observe::SharedError<3> shared;
  if (shared_errs) shared.minimize(residuals, prior, loss, kMaxRounds, 1e-12);

  double inliers = 0;
  Eigen::Matrix<double, 6, 3> pose_by_shared = Eigen::Matrix<double, 6, 3>::Zero();
  for (const Residual& r : residuals) {
    const double residual = r.less(shared.value);
    const double error = std::abs(residual);
    const double w = loss.weight(error);
    out.cost += loss.cost(error);
    inliers += w;
    const Vector6 weighted = w * r.by_pose;
    out.information.noalias() += weighted * r.by_pose.transpose();
    out.gradient += weighted * residual;
    pose_by_shared.noalias() += weighted * r.by_shared.transpose();
  }
  if (shared_errs) {
    for (int k = 0; k < 3; ++k) {
      if (prior[k] < kPinned) out.cost += prior[k] * shared.value[k] * shared.value[k] / 2;
    }
    shared.eliminate(pose_by_shared, out);
  }
  out.information *= share_;
  out.gradient *= share_;
  out.cost *= share_;
  if (!lines_.empty()) {
    const auto all = static_cast<double>(lines_.size());
    out.residuals = std::max(1, static_cast<int>(std::lround(all * share_)));
    out.quality = inliers / all;
  }
  return out;
}

}  // namespace sightline
