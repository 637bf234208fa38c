// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "observe/terms/robust_loss.hpp"
#include "sightline/model/pose_term.hpp"

namespace sightline::observe {

/// Information of an error's prior about zero; what is not allowed for (sigma 0) is pinned to zero.
constexpr double kPinned = 1e12;
inline double prior_information(double sigma) { return sigma > 0 ? 1 / (sigma * sigma) : kPinned; }

/// An error of `kSize` parameters that all residuals of an image share (shift, stretch), and the
/// normal equations that it minimizes. `Residuals` is a range of a type with
///     double error(const Vector& shared) const;     // of the residual less the shared error, >= 0
///     void add_shared(double weight, Matrix& information, Vector& right) const;
template <int kSize>
struct SharedError {
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  Vector value = Vector::Zero();
  Matrix information = Matrix::Zero();
  Vector right = Vector::Zero();

  /// Normal equations with the weights at `value`. `prior`: information of each parameter.
  template <typename Residuals>
  void linearize(const Residuals& residuals, const Vector& prior, const HuberLoss& loss) {
    information = prior.asDiagonal();
    right.setZero();
    for (const auto& residual : residuals) {
      residual.add_shared(loss.weight(residual.error(value)), information, right);
    }
  }

  /// Goes to the minimum by iteratively re-weighted least squares. `information` is left as the
  /// last step had it.
  template <typename Residuals>
  void minimize(const Residuals& residuals, const Vector& prior, const HuberLoss& loss,
                int max_rounds, double settled_squared) {
    for (int round = 0; round < max_rounds; ++round) {
      linearize(residuals, prior, loss);
      const Vector next = information.ldlt().solve(right);
      const bool settled = (next - value).squaredNorm() < settled_squared;
      value = next;
      if (settled) break;
    }
  }

  /// Schur complement: leaves in `term` what the residuals say of the pose whatever the shared
  /// error is. `pose_by_shared`: the block of the normal equations between both.
  void eliminate(const Eigen::Matrix<double, 6, kSize>& pose_by_shared,
                 LinearizedTerm& term) const {
    term.information.noalias() -=
        pose_by_shared * information.ldlt().solve(pose_by_shared.transpose());
    term.information = ((term.information + term.information.transpose()) / 2).eval();
  }
};

}  // namespace sightline::observe
