// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/head_adjust.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>

#include "calibrate/solve/pose_manifold.hpp"

namespace sightline::calibrate {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

void write(const Eigen::MatrixXd& from, int columns, double* to) {
  if (to == nullptr) return;
  Eigen::Map<RowMajor> map(to, from.rows(), columns);
  map.setZero();
  map.leftCols(from.cols()) = from;
}

int row_count(const std::vector<double>& weights) {
  return 2 * static_cast<int>(
                 std::count_if(weights.begin(), weights.end(), [](double w) { return w != 0; }));
}

/// Corners of one body at one setting. Blocks: base, link, camera, encoder, lens, body, error.
class HeadCost : public ceres::CostFunction {
 public:
  HeadCost(const HeadProblem& problem, const HeadView& view, size_t sight)
      : problem_(problem), view_(view), sight_(sight) {
    set_num_residuals(row_count(view.weights[sight]));
    *mutable_parameter_block_sizes() = {7, 2, 7, 5, kLensSize, 7, 2};
  }

  bool Evaluate(const double* const* b, double* residuals, double** jacobians) const override {
    EncoderVector encoder;
    std::copy_n(b[3], 5, encoder.begin());
    Eigen::Vector2d angles;
    Eigen::Matrix<double, 2, 5> by_encoder;
    if (!angles_of(view_, encoder, angles, &by_encoder)) return false;
    angles += Eigen::Vector2d(b[6][0], b[6][1]);
    const HeadChain chain = chain_of(pose_of(b[0]), {b[1][0], b[1][1]}, pose_of(b[2]), angles);
    const BodySight& sight = view_.setting->sights[sight_];
    SightLinearization at;
    if (!linearize(problem_.sights->bodies[sight.body], sight, view_.weights[sight_],
                   problem_.model.lens, b[4], chain.world_from_camera, pose_of(b[5]),
                   jacobians != nullptr, at)) {
      return false;
    }
    const double scale = 1 / corner_sigma(problem_, view_);
    Eigen::Map<Eigen::VectorXd>(residuals, at.error.size()) = scale * at.error;
    if (jacobians == nullptr) return true;
    const Eigen::MatrixXd place = scale * at.place;
    const Eigen::MatrixXd by_angles = place * chain.by_angles;
    write(place * chain.by_base, 7, jacobians[0]);
    write(place * chain.by_link, 2, jacobians[1]);
    write(place, 7, jacobians[2]);
    write(by_angles * by_encoder, 5, jacobians[3]);
    write(scale * at.lens, kLensSize, jacobians[4]);
    write(scale * at.body, 7, jacobians[5]);
    write(by_angles, 2, jacobians[6]);
    return true;
  }

 private:
  const HeadProblem& problem_;
  const HeadView& view_;
  const size_t sight_;
};

/// What a camera that stands still sees of a body.
class FixedCost : public ceres::CostFunction {
 public:
  FixedCost(const HeadProblem& problem, const FixedView& view) : problem_(problem), view_(view) {
    set_num_residuals(row_count(view.weights));
    *mutable_parameter_block_sizes() = {7};
  }

  bool Evaluate(const double* const* b, double* residuals, double** jacobians) const override {
    SightLinearization at;
    if (!linearize(problem_.sights->bodies[view_.sight.sight.body], view_.sight.sight,
                   view_.weights, view_.lens, view_.values.data(), view_.world_from_camera,
                   pose_of(b[0]), jacobians != nullptr, at)) {
      return false;
    }
    Eigen::Map<Eigen::VectorXd>(residuals, at.error.size()) = at.error / problem_.sigma_px;
    if (jacobians != nullptr) write(at.body / problem_.sigma_px, 7, jacobians[0]);
    return true;
  }

 private:
  const HeadProblem& problem_;
  const FixedView& view_;
};

/// What is expected of values: (value - mean) * weight each.
class ExpectedCost : public ceres::CostFunction {
 public:
  ExpectedCost(std::vector<double> means, std::vector<double> weights, int block)
      : means_(std::move(means)), weights_(std::move(weights)) {
    set_num_residuals(static_cast<int>(means_.size()));
    *mutable_parameter_block_sizes() = {block};
  }

  bool Evaluate(const double* const* b, double* residuals, double** jacobians) const override {
    const auto block = static_cast<size_t>(parameter_block_sizes()[0]);
    for (size_t i = 0; i < means_.size(); ++i) residuals[i] = weights_[i] * (b[0][i] - means_[i]);
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    std::fill_n(jacobians[0], means_.size() * block, 0.0);
    for (size_t i = 0; i < means_.size(); ++i) jacobians[0][i * block + i] = weights_[i];
    return true;
  }

 private:
  const std::vector<double> means_, weights_;
};

template <size_t N>
void add_subset(ceres::Problem& problem, double* block, const std::array<bool, N>& free) {
  std::vector<int> held;
  for (size_t i = 0; i < N; ++i) {
    if (!free[i]) held.push_back(static_cast<int>(i));
  }
  auto* manifold = held.empty() || held.size() == N
                       ? nullptr
                       : new ceres::SubsetManifold(static_cast<int>(N), held);
  problem.AddParameterBlock(block, static_cast<int>(N), manifold);
  if (held.size() == N) problem.SetParameterBlockConstant(block);
}

std::array<bool, kLensSize> free_lens(const HeadProblem& problem) {
  std::array<bool, kLensSize> free{};
  std::fill_n(free.begin(), 4 + coefficient_count(problem.model.lens), problem.free.lens);
  return free;
}

/// Of a lens: what holds its distortion.
void add_lens(ceres::Problem& to, const HeadProblem& problem, size_t lens, double* block) {
  add_subset(to, block, free_lens(problem));
  if (!problem.free.lens) return;
  const auto size = static_cast<size_t>(4 + coefficient_count(problem.model.lens));
  std::vector<double> means(size, 0), weights(size, 0);
  for (size_t i = 4; i < size; ++i) {
    means[i] = problem.lens_start[lens][i];
    weights[i] = 1 / coefficient_sigma(static_cast<int>(i));
  }
  to.AddResidualBlock(new ExpectedCost(means, weights, kLensSize), nullptr, block);
}

struct Blocks {
  PoseBlock base, camera;
  std::vector<PoseBlock> bodies;
};

void add_views(ceres::Problem& to, HeadProblem& problem, Blocks& blocks,
               ceres::ParameterBlockOrdering& order) {
  for (HeadView& view : problem.views) {
    if (!view.used) continue;
    to.AddParameterBlock(view.error.data(), 2);
    order.AddElementToGroup(view.error.data(), 0);
    const double root = std::sqrt(view.weight);
    to.AddResidualBlock(new ExpectedCost({0, 0}, {root / view.sigma[0], root / view.sigma[1]}, 2),
                        nullptr, view.error.data());
    for (size_t s = 0; s < view.weights.size(); ++s) {
      if (row_count(view.weights[s]) == 0) continue;
      to.AddResidualBlock(new HeadCost(problem, view, s), nullptr, blocks.base.data(),
                          problem.model.link.data(), blocks.camera.data(),
                          problem.model.encoder.data(), problem.model.lenses[view.lens].data(),
                          blocks.bodies[view.setting->sights[s].body].data(), view.error.data());
    }
  }
  for (const FixedView& view : problem.fixed) {
    if (row_count(view.weights) == 0) continue;
    to.AddResidualBlock(new FixedCost(problem, view), nullptr,
                        blocks.bodies[view.sight.sight.body].data());
  }
}

}  // namespace

bool adjust(HeadProblem& problem, int max_iterations) {
  keep_ceres_quiet();
  HeadModel& model = problem.model;
  Blocks blocks{block_of(model.world_from_base), block_of(model.tilt_from_camera), {}};
  for (const Rigid3& pose : model.world_from_body) blocks.bodies.push_back(block_of(pose));
  ceres::Problem to;
  auto* order = new ceres::ParameterBlockOrdering;
  to.AddParameterBlock(blocks.base.data(), 7, new PoseManifold);
  if (!problem.free.base) to.SetParameterBlockConstant(blocks.base.data());
  to.AddParameterBlock(model.link.data(), 2);
  to.AddParameterBlock(blocks.camera.data(), 7, new PoseManifold);
  add_subset(to, model.encoder.data(), problem.free.encoder);
  for (double* block :
       {blocks.base.data(), model.link.data(), blocks.camera.data(), model.encoder.data()}) {
    order->AddElementToGroup(block, 1);
  }
  for (size_t i = 0; i < model.lenses.size(); ++i) {
    add_lens(to, problem, i, model.lenses[i].data());
    order->AddElementToGroup(model.lenses[i].data(), 1);
  }
  for (size_t i = 0; i < blocks.bodies.size(); ++i) {
    to.AddParameterBlock(blocks.bodies[i].data(), 7, new PoseManifold);
    if (!problem.free.bodies[i]) to.SetParameterBlockConstant(blocks.bodies[i].data());
    order->AddElementToGroup(blocks.bodies[i].data(), 1);
  }
  add_views(to, problem, blocks, *order);
  ceres::Solver::Options solver;
  solver.linear_solver_ordering.reset(order);
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.max_num_iterations = max_iterations;
  solver.function_tolerance = 1e-9;
  solver.gradient_tolerance = 1e-14;
  solver.parameter_tolerance = 1e-9;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &to, &summary);
  model.world_from_base = pose_of(blocks.base.data());
  model.tilt_from_camera = pose_of(blocks.camera.data());
  for (size_t i = 0; i < blocks.bodies.size(); ++i) {
    model.world_from_body[i] = pose_of(blocks.bodies[i].data());
  }
  return summary.IsSolutionUsable();
}

}  // namespace sightline::calibrate
