// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/line_term.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <utility>

#include "line_jacobian.hpp"

namespace sightline {

namespace {

using Shared = Eigen::Vector3d;  // (b_x, b_y, o)

constexpr double kPinned = 1e12;

double prior_of(double sigma) { return sigma > 0 ? 1 / (sigma * sigma) : kPinned; }

}  // namespace

/// One line at a pose, everything divided by its sigma.
struct LineTerm::Seen {
  Vector6 by_pose;
  Shared by_shared;
  double residual;
  double weight = 1;
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

LinearizedTerm LineTerm::linearize(const Rigid3& world_from_object) const {
  constexpr size_t kMaxOnStack = 512;
  const observe::LineProjector projector(camera_->model, camera_from_world_ * world_from_object);
  std::array<Seen, kMaxOnStack> on_stack;
  std::vector<Seen> on_heap;
  if (lines_.size() > kMaxOnStack) on_heap.resize(lines_.size());
  Seen* const seen = on_heap.empty() ? on_stack.data() : on_heap.data();
  size_t count = 0;
  LinearizedTerm out;
  for (const LineMatch& line : lines_) {
    double distance = 0;
    Seen& s = seen[count];
    if (!projector.distance(line.point_in_object, line.center, line.normal, distance, s.by_pose)) {
      out.cost += huber_ * (kUnseenError - huber_ / 2);
      continue;
    }
    double residual = distance - static_cast<double>(line.offset[0]);
    for (int k = 1; k < line.offsets; ++k) {
      const double other = distance - static_cast<double>(line.offset[static_cast<size_t>(k)]);
      if (std::abs(other) < std::abs(residual)) residual = other;
    }
    const double scale = 1 / line.sigma_px;
    s.by_pose *= scale;
    s.residual = residual * scale;
    s.by_shared = Shared(line.normal.x(), line.normal.y(), 1.0) * scale;
    s.weight = 1;
    ++count;
  }

  // The errors that all share, by iteratively re-weighted least squares; their priors do not get
  // stronger with fewer independent lines.
  const bool shared_errs = error_.shift_px > 0 || error_.dilate_px > 0;
  const Shared prior(prior_of(error_.shift_px) / share_, prior_of(error_.shift_px) / share_,
                     prior_of(error_.dilate_px) / share_);
  Shared shared = Shared::Zero();
  Eigen::Matrix3d system = Eigen::Matrix3d::Zero();
  constexpr int kMaxRounds = 30;
  for (int round = 0; round < kMaxRounds; ++round) {
    system = prior.asDiagonal();
    Shared right = Shared::Zero();
    for (size_t i = 0; i < count; ++i) {
      Seen& s = seen[i];
      s.weight = weight(std::abs(s.residual - s.by_shared.dot(shared)));
      const Shared weighted = s.weight * s.by_shared;
      system.noalias() += weighted * s.by_shared.transpose();
      right += weighted * s.residual;
    }
    if (!shared_errs) break;
    const Shared next = system.ldlt().solve(right);
    const bool settled = (next - shared).squaredNorm() < 1e-12;
    shared = next;
    if (settled) break;
  }

  double inliers = 0;
  Eigen::Matrix<double, 6, 3> pose_by_shared = Eigen::Matrix<double, 6, 3>::Zero();
  for (size_t i = 0; i < count; ++i) {
    const Seen& s = seen[i];
    const double residual = s.residual - s.by_shared.dot(shared);
    const double error = std::abs(residual);
    const double w = weight(error);
    out.cost += error <= huber_ ? error * error / 2 : huber_ * (error - huber_ / 2);
    inliers += w;
    const Vector6 weighted = w * s.by_pose;
    out.information.noalias() += weighted * s.by_pose.transpose();
    out.gradient += weighted * residual;
    pose_by_shared.noalias() += weighted * s.by_shared.transpose();
  }
  if (shared_errs) {
    for (int k = 0; k < 3; ++k) {
      if (prior[k] < kPinned) out.cost += prior[k] * shared[k] * shared[k] / 2;
    }
    out.information.noalias() -= pose_by_shared * system.ldlt().solve(pose_by_shared.transpose());
    out.information = ((out.information + out.information.transpose()) / 2).eval();
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
