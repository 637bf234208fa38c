// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/covariance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace sightline::calibrate {
namespace {

/// What one view says: derivatives by the estimated parameters of its camera and the bend.
struct ViewBlock {
  std::vector<int> columns;  ///< in the layout
  Eigen::MatrixXd camera, target;
};

ViewBlock block_of(const Bundle& bundle, const BundleView& view, const CovarianceLayout& layout,
                   const ViewLinearization& at) {
  const CovarianceLayout::Camera& c = layout.cameras[view.camera];
  ViewBlock block;
  for (size_t i = 0; i < c.parameters.size(); ++i) {
    block.columns.push_back(c.lens + static_cast<int>(i));
  }
  for (int i = 0; c.place >= 0 && i < 6; ++i) block.columns.push_back(c.place + i);
  for (int i = 0; bundle.bend_free && i < 2; ++i) block.columns.push_back(layout.bend + i);
  block.camera.resize(at.error.size(), static_cast<Eigen::Index>(block.columns.size()));
  Eigen::Index column = 0;
  for (const int parameter : c.parameters) block.camera.col(column++) = at.lens.col(parameter);
  for (int i = 0; c.place >= 0 && i < 6; ++i) block.camera.col(column++) = at.place.col(i);
  for (int i = 0; bundle.bend_free && i < 2; ++i) block.camera.col(column++) = at.bend.col(i);
  block.target = at.target;
  return block;
}

void add(Eigen::MatrixXd& sum, const std::vector<int>& rows, const std::vector<int>& columns,
         const Eigen::MatrixXd& part, double sign) {
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t j = 0; j < columns.size(); ++j) {
      sum(rows[i], columns[j]) +=
          sign * part(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  }
}

/// Adds the views of one set, their common target pose eliminated.
void add_set(const std::vector<ViewBlock>& blocks, Eigen::MatrixXd& information) {
  Matrix6 target = Matrix6::Zero();
  for (const ViewBlock& b : blocks) target += b.target.transpose() * b.target;
  const Eigen::LDLT<Matrix6> inverse(target);
  std::vector<Eigen::MatrixXd> cross;
  for (const ViewBlock& b : blocks) cross.push_back(b.target.transpose() * b.camera);
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (blocks[i].columns.empty()) continue;
    add(information, blocks[i].columns, blocks[i].columns,
        blocks[i].camera.transpose() * blocks[i].camera, 1);
    const Eigen::MatrixXd solved = inverse.solve(cross[i]);
    for (size_t j = 0; j < blocks.size(); ++j) {
      add(information, blocks[j].columns, blocks[i].columns, cross[j].transpose() * solved, -1);
    }
  }
}

}  // namespace

Eigen::MatrixXd scaled_inverse(const Eigen::MatrixXd& information) {
  constexpr double kLeastEigenvalue = 1e-13;  // of a matrix with ones on its diagonal
  const Eigen::VectorXd diagonal = information.diagonal();
  if (!(diagonal.minCoeff() > 0)) return {};
  const Eigen::VectorXd scale = diagonal.cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  if (information.rows() <= 400) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled, Eigen::EigenvaluesOnly);
    if (!(eigen.eigenvalues().minCoeff() > kLeastEigenvalue)) return {};
  }
  const Eigen::LLT<Eigen::MatrixXd> cholesky(scaled);
  if (cholesky.info() != Eigen::Success) return {};
  const Eigen::MatrixXd inverse =
      cholesky.solve(Eigen::MatrixXd::Identity(scaled.rows(), scaled.cols()));
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

CovarianceLayout layout_of(const Bundle& bundle) {
  CovarianceLayout layout;
  for (const BundleCamera& camera : bundle.cameras) {
    CovarianceLayout::Camera c;
    c.lens = layout.size;
    for (int i = 0; i < kLensSize; ++i) {
      if (camera.free[static_cast<size_t>(i)]) c.parameters.push_back(i);
    }
    layout.size += static_cast<int>(c.parameters.size());
    if (camera.place_free) {
      c.place = layout.size;
      layout.size += 6;
    }
    layout.cameras.push_back(std::move(c));
  }
  if (bundle.bend_free) {
    layout.bend = layout.size;
    layout.size += 2;
  }
  return layout;
}

RigCovariance rig_covariance(const Bundle& bundle) {
  RigCovariance out;
  out.layout = layout_of(bundle);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(out.layout.size, out.layout.size);
  std::vector<std::vector<ViewBlock>> by_set(bundle.world_from_target.size());
  double cost = 0;
  Eigen::Index rows = 0;
  for (const BundleView& view : bundle.views) {
    ViewLinearization at;
    if (std::count(view.used.begin(), view.used.end(), 1) == 0 ||
        !linearize(*bundle.target, view, state_of(bundle, view), true, at)) {
      continue;
    }
    by_set[view.set].push_back(block_of(bundle, view, out.layout, at));
    cost += at.error.squaredNorm();
    rows += at.error.size();
  }
  Eigen::Index unknowns = out.layout.size;
  for (auto& blocks : by_set) {
    if (blocks.empty()) continue;
    unknowns += 6;
    add_set(blocks, information);
    blocks.clear();
  }
  for (size_t c = 0; c < bundle.cameras.size(); ++c) {
    const CovarianceLayout::Camera& camera = out.layout.cameras[c];
    for (size_t i = 0; i < camera.parameters.size(); ++i) {
      const double weight = coefficient_cost(bundle.cameras[c].lens, camera.parameters[i]);
      const auto at = camera.lens + static_cast<Eigen::Index>(i);
      information(at, at) += weight * weight;
    }
  }
  const double freedom = static_cast<double>(std::max<Eigen::Index>(1, rows - unknowns));
  out.sigma_px = std::sqrt(cost / freedom);
  if (out.layout.size == 0) return out;
  out.matrix = scaled_inverse(information) * (out.sigma_px * out.sigma_px);
  out.singular = out.matrix.size() == 0 || rows <= unknowns;
  return out;
}

}  // namespace sightline::calibrate
