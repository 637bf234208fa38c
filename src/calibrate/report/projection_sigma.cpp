// SPDX-License-Identifier: Apache-2.0
#include "calibrate/report/projection_sigma.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline::calibrate {
namespace {

constexpr int kColumns = 16, kRows = 12;
constexpr size_t kMaxCorners = 400;

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Derivatives of a projection by what was estimated of the lens, and by a pose.
struct Slopes {
  Eigen::Matrix<double, 2, Eigen::Dynamic> lens;
  Eigen::Matrix<double, 2, 6> pose;
};

std::optional<Slopes> slopes(const BundleCamera& camera, const std::vector<int>& columns,
                             const Eigen::Vector3d& point) {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::Matrix<double, 2, 12> by_lens;
  if (!project_lens(camera.lens, camera.values.data(), point, pixel, &by_point, &by_lens)) {
    return std::nullopt;
  }
  Slopes out;
  out.lens.setZero(2, static_cast<Eigen::Index>(columns.size()));
  for (size_t i = 0; i < columns.size(); ++i) {
    if (columns[i] < kTimeOffset)
      out.lens.col(static_cast<Eigen::Index>(i)) = by_lens.col(columns[i]);
  }
  out.pose << by_point * skew(point), -by_point;
  return out;
}

/// Pose error that an error of the lens looks like: pose = compensation * lens.
Eigen::MatrixXd compensation(const CalibrationViews& views, const Bundle& rig, size_t c,
                             const std::vector<int>& columns) {
  const BundleCamera& camera = rig.cameras[c];
  const Rigid3 camera_from_world = camera.world_from_camera.inverse();
  size_t all = 0, turn = 0;
  for (const TargetView& view : views.views) all += view.camera == c ? view.corners.size() : 0;
  const size_t stride = 1 + all / kMaxCorners;
  Matrix6 normal = 1e-9 * Matrix6::Identity();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(6, static_cast<Eigen::Index>(columns.size()));
  for (const BundleView& view : rig.views) {
    if (view.camera != c) continue;
    for (size_t i = 0; i < view.used.size(); ++i) {
      if (!view.used[i] || turn++ % stride != 0) continue;
      const Eigen::Vector3d corner = bent_corner(*rig.target, rig.bend, view.view->corners[i].id);
      const auto s =
          slopes(camera, columns, camera_from_world * (rig.world_from_target[view.set] * corner));
      if (!s) continue;
      normal += s->pose.transpose() * s->pose;
      right += s->pose.transpose() * s->lens;
    }
  }
  return -normal.ldlt().solve(right);
}

}  // namespace

std::optional<ProjectionSigma> projection_sigma(const CalibrationViews& views, const Bundle& rig,
                                                const RigSolution& solution, size_t c,
                                                double distance) {
  const SolvedCamera& solved = solution.cameras[c];
  if (solved.lens_known) return std::nullopt;
  const auto lenses = static_cast<Eigen::Index>(solved.lens_columns.size());
  const Eigen::MatrixXd covariance = solved.covariance.topLeftCorner(lenses, lenses);
  const Eigen::MatrixXd pose = compensation(views, rig, c, solved.lens_columns);
  const CameraModel& model = solved.camera.model;
  const auto sigma_at = [&](const Eigen::Vector2d& pixel) {
    const auto ray = model.unproject(pixel);
    const auto s = ray ? slopes(rig.cameras[c], solved.lens_columns, *ray * distance)
                       : std::optional<Slopes>();
    if (!s) return std::numeric_limits<double>::quiet_NaN();
    const Eigen::MatrixXd j = s->lens + s->pose * pose;
    // The longer half axis of the ellipse of one sigma.
    const Eigen::Matrix2d at = j * covariance * j.transpose();
    const double mean = (at(0, 0) + at(1, 1)) / 2;
    return std::sqrt(mean + std::hypot((at(0, 0) - at(1, 1)) / 2, at(0, 1)));
  };
  ProjectionSigma out;
  out.columns = kColumns;
  out.rows = kRows;
  out.distance = distance;
  std::vector<double> edge;
  const double width = model.width() - 1, height = model.height() - 1;
  out.center = sigma_at({width / 2, height / 2});
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      out.values.push_back(
          sigma_at({width * column / (kColumns - 1.0), height * row / (kRows - 1.0)}));
      if (!std::isfinite(out.values.back())) continue;
      out.worst = std::max(out.worst, out.values.back());
      const bool outermost = row == 0 || row == kRows - 1 || column == 0 || column == kColumns - 1;
      if (outermost) edge.push_back(out.values.back());
    }
  }
  out.edge = median(std::move(edge));
  return out;
}

}  // namespace sightline::calibrate
