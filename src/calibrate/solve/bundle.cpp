// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/bundle.hpp"

#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "calibrate/solve/corner_at_set.hpp"
#include "calibrate/solve/pose_manifold.hpp"

namespace sightline::calibrate {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// One view: all of its corners share their parameters, so they are one block of residuals.
class ViewCost : public ceres::CostFunction {
 public:
  ViewCost(const Bundle& bundle, const BundleView& view, double huber_px)
      : target_(*bundle.target),
        lens_(bundle.cameras[view.camera].lens),
        height_(bundle.cameras[view.camera].height),
        view_(view),
        huber_(huber_px) {
    const auto used = std::count(view.used.begin(), view.used.end(), 1);
    set_num_residuals(2 * static_cast<int>(used));
    *mutable_parameter_block_sizes() = {kLensSize, 7, 7, 2};
  }

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const ViewState state{lens_,
                          height_,
                          blocks[0],
                          pose_of(blocks[1]),
                          pose_of(blocks[2]),
                          {blocks[3][0], blocks[3][1]}};
    ViewLinearization at;
    if (!linearize(target_, view_, state, jacobians != nullptr, at)) return false;
    if (huber_ > 0) soften(at);
    std::copy_n(at.error.data(), at.error.size(), residuals);
    if (jacobians == nullptr) return true;
    write(at.lens, kLensSize, jacobians[0]);
    write(at.place, 7, jacobians[1]);
    write(at.target, 7, jacobians[2]);
    write(at.bend, 2, jacobians[3]);
    return true;
  }

 private:
  // Huber's loss on each corner, as a residual e' with |e'|^2 = rho(|e|^2): e' = k(|e|) e.
  void soften(ViewLinearization& at) const {
    for (Eigen::Index row = 0; row < at.error.size(); row += 2) {
      const Eigen::Vector2d e = at.error.segment<2>(row);
      const double norm = e.norm();
      if (norm <= huber_) continue;
      const double rho = 2 * huber_ * norm - huber_ * huber_;
      const double k = std::sqrt(rho) / norm;
      const double k_slope = huber_ / (std::sqrt(rho) * norm) - k / norm;
      const Eigen::Matrix2d by_error =
          k * Eigen::Matrix2d::Identity() + k_slope / norm * e * e.transpose();
      at.error.segment<2>(row) = k * e;
      for (RowMajor* j : {&at.lens, &at.place, &at.target, &at.bend}) {
        if (j->rows() > 0) j->middleRows<2>(row) = (by_error * j->middleRows<2>(row)).eval();
      }
    }
  }

  static void write(const RowMajor& from, int columns, double* to) {
    if (to == nullptr) return;
    Eigen::Map<RowMajor> map(to, from.rows(), columns);
    map.setZero();
    map.leftCols(from.cols()) = from;
  }

  const CalibrationTarget& target_;
  const LensModel lens_;
  const int height_;
  const BundleView& view_;
  const double huber_;
};

/// See coefficient_cost().
class CoefficientCost : public ceres::SizedCostFunction<8, kLensSize> {
 public:
  explicit CoefficientCost(LensModel lens) : lens_(lens) {}
  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      std::fill_n(jacobians[0], 8 * kLensSize, 0.0);
    }
    for (int i = 0; i < 8; ++i) {
      const double cost = coefficient_cost(lens_, 4 + i);
      residuals[i] = cost * blocks[0][4 + i];
      if (jacobians != nullptr && jacobians[0] != nullptr) {
        jacobians[0][i * kLensSize + 4 + i] = cost;
      }
    }
    return true;
  }

 private:
  const LensModel lens_;
};

void add_camera(ceres::Problem& problem, const BundleCamera& camera, double* lens, double* place) {
  std::vector<int> fixed;
  for (int i = 0; i < kLensSize; ++i) {
    if (!camera.free[static_cast<size_t>(i)]) fixed.push_back(i);
  }
  if (fixed.size() == kLensSize) {
    problem.AddParameterBlock(lens, kLensSize);
    problem.SetParameterBlockConstant(lens);
  } else if (fixed.empty()) {
    problem.AddParameterBlock(lens, kLensSize);
  } else {
    problem.AddParameterBlock(lens, kLensSize, new ceres::SubsetManifold(kLensSize, fixed));
  }
  if (camera.lens == LensModel::kRational && fixed.size() < kLensSize) {
    problem.AddResidualBlock(new CoefficientCost(camera.lens), nullptr, lens);
  }
  problem.AddParameterBlock(place, 7, new PoseManifold);
  if (!camera.place_free) problem.SetParameterBlockConstant(place);
}

}  // namespace

void keep_ceres_quiet() {
  static const bool done = [] {
    FLAGS_minloglevel = google::GLOG_FATAL;
    return true;
  }();
  (void)done;
}

double coefficient_cost(LensModel lens, int parameter) {
  const bool radial = parameter >= 4 && parameter != 6 && parameter != 7 && parameter < 12;
  return lens == LensModel::kRational && radial ? 0.05 : 0;
}

size_t Bundle::corner_count() const {
  size_t count = 0;
  for (const BundleView& view : views) {
    count += static_cast<size_t>(std::count(view.used.begin(), view.used.end(), 1));
  }
  return count;
}

Eigen::Vector3d bent_corner(const CalibrationTarget& target, const Eigen::Vector2d& bend, int id) {
  const Eigen::Vector2d at = target.corner(id), size = target.size();
  if (id >= target.own_corner_count()) return {at.x(), at.y(), 0};
  const double u = 2 * at.x() / size.x() - 1, v = 2 * at.y() / size.y() - 1;
  return {at.x(), at.y(), bend.x() * (1 - u * u) + bend.y() * (1 - v * v)};
}

std::optional<Eigen::Vector2d> corner_error(const Bundle& bundle, const BundleView& view,
                                            size_t corner) {
  const BundleCamera& camera = bundle.cameras[view.camera];
  const TargetCorner& c = view.view->corners[corner];
  const Eigen::Vector3d point =
      camera.world_from_camera.inverse() *
      (bundle.world_from_target[view.set] * bent_corner(*bundle.target, bundle.bend, c.id));
  Eigen::Vector2d pixel;
  if (!project_lens(camera.lens, camera.values.data(), point, pixel, nullptr, nullptr)) {
    return std::nullopt;
  }
  return Eigen::Vector2d(pixel -
                         corner_at_set(*view.view, c, camera.values.data(), camera.height).pixel);
}

ViewState state_of(const Bundle& bundle, const BundleView& view) {
  const BundleCamera& camera = bundle.cameras[view.camera];
  return {camera.lens,
          camera.height,
          camera.values.data(),
          camera.world_from_camera,
          bundle.world_from_target[view.set],
          bundle.bend};
}

bool linearize(const CalibrationTarget& target, const BundleView& view, const ViewState& state,
               bool derivatives, ViewLinearization& out) {
  const Rigid3 camera_from_target = state.world_from_camera.inverse() * state.world_from_target;
  const Eigen::Matrix3d rotation = camera_from_target.rotation_matrix();
  const Eigen::Vector2d size = target.size();
  const auto rows = 2 * std::count(view.used.begin(), view.used.end(), 1);
  out.error.resize(rows);
  const Eigen::Index full = derivatives ? rows : 0;
  out.lens.resize(full, kLensSize);
  out.place.resize(full, 6);
  out.target.resize(full, 6);
  out.bend.resize(full, 2);
  Eigen::Index row = 0;
  for (size_t i = 0; i < view.used.size(); ++i) {
    if (view.used[i] == 0) continue;
    const TargetCorner& corner = view.view->corners[i];
    const Eigen::Vector3d in_target = bent_corner(target, state.bend, corner.id);
    const Eigen::Vector3d in_camera = rotation * in_target + camera_from_target.translation;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, 12> by_lens;
    if (!project_lens(state.lens, state.values, in_camera, pixel, derivatives ? &by_point : nullptr,
                      derivatives ? &by_lens : nullptr)) {
      return false;
    }
    const CornerAtSet seen = corner_at_set(*view.view, corner, state.values, state.height);
    out.error.segment<2>(row) = pixel - seen.pixel;
    if (derivatives) {
      out.lens.middleRows<2>(row).leftCols<12>() = by_lens;
      out.lens.middleRows<2>(row).col(kTimeOffset) = -seen.by_offset;
      out.lens.middleRows<2>(row).col(kReadout) = -seen.by_readout;
      out.place.middleRows<2>(row).leftCols<3>() = by_point * skew(in_camera);
      out.place.middleRows<2>(row).rightCols<3>() = -by_point;
      const Eigen::Matrix<double, 2, 3> by_target = by_point * rotation;
      out.target.middleRows<2>(row).leftCols<3>() = -by_target * skew(in_target);
      out.target.middleRows<2>(row).rightCols<3>() = by_target;
      const bool bent = corner.id < target.own_corner_count();
      const double u = bent ? 2 * in_target.x() / size.x() - 1 : 1;
      const double v = bent ? 2 * in_target.y() / size.y() - 1 : 1;
      out.bend.middleRows<2>(row).col(0) = by_target.col(2) * (1 - u * u);
      out.bend.middleRows<2>(row).col(1) = by_target.col(2) * (1 - v * v);
    }
    row += 2;
  }
  return true;
}

BundleSummary adjust(Bundle& bundle, const BundleOptions& options) {
  keep_ceres_quiet();
  std::vector<PoseBlock> places, targets;
  for (const BundleCamera& c : bundle.cameras) places.push_back(block_of(c.world_from_camera));
  for (const Rigid3& pose : bundle.world_from_target) targets.push_back(block_of(pose));
  ceres::Problem problem;
  auto* order = new ceres::ParameterBlockOrdering;
  for (size_t i = 0; i < bundle.cameras.size(); ++i) {
    add_camera(problem, bundle.cameras[i], bundle.cameras[i].values.data(), places[i].data());
    order->AddElementToGroup(bundle.cameras[i].values.data(), 1);
    order->AddElementToGroup(places[i].data(), 1);
  }
  problem.AddParameterBlock(bundle.bend.data(), 2);
  order->AddElementToGroup(bundle.bend.data(), 1);
  if (!bundle.bend_free) problem.SetParameterBlockConstant(bundle.bend.data());
  std::vector<char> added(targets.size(), 0);
  for (const BundleView& view : bundle.views) {
    if (std::count(view.used.begin(), view.used.end(), 1) == 0) continue;
    double* target = targets[view.set].data();
    if (!added[view.set]) {
      problem.AddParameterBlock(target, 7, new PoseManifold);
      order->AddElementToGroup(target, 0);
      added[view.set] = 1;
    }
    problem.AddResidualBlock(new ViewCost(bundle, view, options.huber_px), nullptr,
                             bundle.cameras[view.camera].values.data(), places[view.camera].data(),
                             target, bundle.bend.data());
  }
  ceres::Solver::Options solver;
  solver.linear_solver_ordering.reset(order);
  solver.linear_solver_type = bundle.cameras.size() > 30 ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
  solver.max_num_iterations = options.max_iterations;
  // On the parameters, not on the cost: long chains of cameras still move where it hardly changes.
  solver.function_tolerance = 1e-12;
  solver.gradient_tolerance = 1e-14;
  solver.parameter_tolerance = 1e-9;
  solver.num_threads = options.threads;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  for (size_t i = 0; i < bundle.cameras.size(); ++i) {
    bundle.cameras[i].world_from_camera = pose_of(places[i].data());
  }
  for (size_t i = 0; i < targets.size(); ++i) {
    bundle.world_from_target[i] = pose_of(targets[i].data());
  }
  double sum = 0;
  for (const BundleView& view : bundle.views) {
    for (size_t i = 0; i < view.used.size(); ++i) {
      if (view.used[i] == 0) continue;
      const auto error = corner_error(bundle, view, i);
      sum += error ? error->squaredNorm() : 1e6;
    }
  }
  const double count = static_cast<double>(std::max<size_t>(1, bundle.corner_count()));
  return {std::sqrt(sum / count), static_cast<int>(summary.iterations.size()),
          summary.termination_type == ceres::CONVERGENCE};
}

}  // namespace sightline::calibrate
