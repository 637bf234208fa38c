// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/target_pose.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "calibrate/solve/corner_at_set.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kLeastRayDepth = 0.15;  // rays flatter than this do not enter the homography

/// Translation and scale that bring points to a mean of 0 and a mean distance of sqrt(2).
Eigen::Matrix3d normalization(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  double distance = 0;
  for (const auto& p : points) distance += (p - mean).norm();
  distance /= static_cast<double>(points.size());
  const double scale = distance > 0 ? std::sqrt(2.0) / distance : 1;
  Eigen::Matrix3d t;
  t << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return t;
}

std::optional<Rigid3> pose_from_homography(Eigen::Matrix3d h) {
  const double scale = (h.col(0).norm() + h.col(1).norm()) / 2;
  if (!(scale > 0)) return std::nullopt;
  h /= h(2, 2) < 0 ? -scale : scale;
  Eigen::Matrix3d r;
  r << h.col(0), h.col(1), h.col(0).cross(h.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  if (rotation.determinant() < 0) return std::nullopt;
  if (!h.allFinite() || h(2, 2) <= 0) return std::nullopt;
  return Rigid3(Eigen::Quaterniond(rotation), h.col(2));
}

/// The other pose of a plane that looks nearly the same from far away: its tilt the other way.
Rigid3 tilted_back(const Rigid3& pose, const Eigen::Vector3d& middle_in_target) {
  const Eigen::Vector3d middle = pose * middle_in_target;
  const Eigen::Vector3d sight = middle.normalized();
  const Eigen::Vector3d normal = pose.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d axis = sight.cross(normal);
  if (axis.norm() < 1e-6) return pose;
  const double angle = std::atan2(axis.norm(), sight.dot(normal));
  const Eigen::Quaterniond back(Eigen::AngleAxisd(-2 * angle, axis.normalized()));
  const Eigen::Quaterniond rotation = back * pose.rotation;
  return {rotation, middle - rotation * middle_in_target};
}

double squared(const ViewLinearization& at) { return at.error.squaredNorm(); }

/// Levenberg-Marquardt on the pose alone.
std::optional<TargetPose> refine(const CalibrationTarget& target, const BundleView& view,
                                 ViewState state, const Rigid3& start) {
  state.world_from_camera = Rigid3();
  state.world_from_target = start;
  ViewLinearization at, next;
  if (!linearize(target, view, state, true, at)) return std::nullopt;
  double damping = 1e-4;
  for (int step = 0; step < 40 && damping < 1e8; ++step) {
    const Matrix6 h = at.target.transpose() * at.target;
    const Vector6 g = at.target.transpose() * at.error;
    Matrix6 damped = h;
    damped.diagonal() *= 1 + damping;
    const Vector6 delta = -damped.ldlt().solve(g);
    ViewState trial = state;
    trial.world_from_target = state.world_from_target * Rigid3::exp(delta);
    if (delta.allFinite() && linearize(target, view, trial, true, next) &&
        squared(next) < squared(at)) {
      const bool done = squared(at) - squared(next) < 1e-10 * squared(at);
      state = trial;
      std::swap(at, next);
      damping *= 0.1;
      if (done) break;
    } else {
      damping *= 10;
    }
  }
  const double corners = static_cast<double>(at.error.size()) / 2;
  return TargetPose{state.world_from_target, std::sqrt(squared(at) / corners)};
}

}  // namespace

std::optional<Eigen::Matrix3d> homography(const std::vector<Eigen::Vector2d>& from,
                                          const std::vector<Eigen::Vector2d>& to) {
  if (from.size() < 4) return std::nullopt;
  const Eigen::Matrix3d a = normalization(from), b = normalization(to);
  Eigen::MatrixXd m(2 * static_cast<Eigen::Index>(from.size()), 9);
  m.setZero();
  for (size_t i = 0; i < from.size(); ++i) {
    const Eigen::RowVector3d p = (a * from[i].homogeneous()).transpose();
    const Eigen::Vector3d q = b * to[i].homogeneous();
    const auto row = static_cast<Eigen::Index>(2 * i);
    m.row(row) << p, Eigen::RowVector3d::Zero(), -q.x() * p;
    m.row(row + 1) << Eigen::RowVector3d::Zero(), p, -q.y() * p;
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(m, Eigen::ComputeFullV);
  const auto& values = svd.singularValues();
  if (!(values[7] > 1e-9 * values[0])) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> v = svd.matrixV().col(8);
  Eigen::Matrix3d h;
  h << v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8];
  return Eigen::Matrix3d(b.inverse() * h * a);
}

std::optional<TargetPose> target_pose(const CalibrationTarget& target, const Eigen::Vector2d& bend,
                                      LensModel lens, const LensVector& values,
                                      const TargetView& view, const std::vector<char>* only) {
  auto model = CameraModel::create(lens_parameters(lens, values, 1 << 14, 1 << 14), "lens");
  if (!model) return std::nullopt;
  BundleView used{&view, 0, 0, std::vector<char>(view.corners.size(), 1)};
  if (only != nullptr) used.used = *only;
  std::vector<Eigen::Vector2d> points, rays;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < view.corners.size(); ++i) {
    if (used.used[i] == 0) continue;
    const auto ray = model->unproject(corner_at_set(view, view.corners[i], values.data(), 0).pixel);
    if (!ray || ray->z() < kLeastRayDepth) continue;
    points.push_back(target.corner(view.corners[i].id));
    rays.emplace_back(ray->head<2>() / ray->z());
    middle += points.back();
  }
  const auto h = homography(points, rays);
  if (!h) return std::nullopt;
  const auto start = pose_from_homography(*h);
  if (!start) return std::nullopt;
  middle /= static_cast<double>(points.size());
  const ViewState state{lens, 0, values.data(), {}, {}, bend};  // a start: without read-out
  auto best = refine(target, used, state, *start);
  const Rigid3 other =
      tilted_back(best ? best->camera_from_target : *start, {middle.x(), middle.y(), 0});
  const auto second = refine(target, used, state, other);
  if (second && (!best || second->rms_px < best->rms_px)) best = second;
  return best;
}

namespace {

struct Candidate {
  LensVector values{};
  double rms_px = 0;
};

/// At most `count` of them, evenly taken.
std::vector<const TargetView*> some(const std::vector<const TargetView*>& views, size_t count) {
  if (views.size() <= count) return views;
  std::vector<const TargetView*> out;
  for (size_t i = 0; i < count; ++i) out.push_back(views[i * views.size() / count]);
  return out;
}

/// Poses of the views through a lens; rms over those that can be explained, and they must be half.
std::optional<Bundle> with_poses(const CalibrationTarget& target, LensModel lens,
                                 const LensVector& values,
                                 const std::vector<const TargetView*>& views, double& rms_px) {
  Bundle bundle;
  bundle.target = &target;
  BundleCamera camera;
  camera.lens = lens;
  camera.values = values;
  camera.place_free = false;
  bundle.cameras.push_back(camera);
  double sum = 0;
  for (const TargetView* view : views) {
    const auto pose = target_pose(target, Eigen::Vector2d::Zero(), lens, values, *view);
    if (!pose) continue;
    bundle.views.push_back(
        {view, 0, bundle.world_from_target.size(), std::vector<char>(view->corners.size(), 1)});
    bundle.world_from_target.push_back(pose->camera_from_target);
    sum += pose->rms_px * pose->rms_px;
  }
  if (2 * bundle.views.size() < views.size() || bundle.views.empty()) return std::nullopt;
  rms_px = std::sqrt(sum / static_cast<double>(bundle.views.size()));
  return bundle;
}

}  // namespace

std::optional<LensVector> initial_lens(const CalibrationTarget& target, LensModel lens, int width,
                                       int height, const std::vector<const TargetView*>& all) {
  constexpr std::array kFocals = {0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0};  // of the width
  constexpr size_t kTried = 3;
  const std::vector<const TargetView*> views = some(all, 10);
  std::vector<Candidate> candidates;
  for (const double focal : kFocals) {
    Candidate c;
    c.values[0] = c.values[1] = focal * width;
    c.values[2] = (width - 1) / 2.0;
    c.values[3] = (height - 1) / 2.0;
    if (with_poses(target, lens, c.values, views, c.rms_px)) candidates.push_back(c);
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.rms_px < b.rms_px; });
  if (candidates.size() > kTried) candidates.resize(kTried);
  std::optional<Candidate> best;
  for (const Candidate& candidate : candidates) {
    double rms = 0;
    auto bundle = with_poses(target, lens, candidate.values, views, rms);
    if (!bundle) continue;
    BundleCamera& camera = bundle->cameras.front();
    camera.free[0] = camera.free[1] = camera.free[4] = true;
    BundleOptions options;
    options.max_iterations = 25;
    const BundleSummary summary = adjust(*bundle, options);
    if (!(camera.values[0] > 0) || !(camera.values[1] > 0)) continue;
    if (!best || summary.rms_px < best->rms_px) best = Candidate{camera.values, summary.rms_px};
  }
  if (!best) return std::nullopt;
  return best->values;
}

}  // namespace sightline::calibrate
