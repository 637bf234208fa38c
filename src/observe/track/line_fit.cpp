// SPDX-License-Identifier: Apache-2.0
#include "observe/track/line_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "observe/terms/robust_loss.hpp"

namespace sightline::observe {

Vector6 fit_lines(std::span<const LineResidual> lines, const Matrix6& prior, const Vector6& at,
                  double huber) {
  constexpr int kRounds = 4;
  const HuberLoss loss(huber);
  Vector6 x = Vector6::Zero();
  for (int round = 0; round < kRounds; ++round) {
    Matrix6 system = prior;
    Vector6 right = -prior * at;
    for (const LineResidual& line : lines) {
      const double error = std::abs(line.by_pose.dot(x) - line.offset) / line.sigma;
      const double weight = loss.weight(error) / (line.sigma * line.sigma);
      const Vector6 weighted = weight * line.by_pose;
      system.noalias() += weighted * line.by_pose.transpose();
      right += weighted * line.offset;
    }
    x = system.ldlt().solve(right);
  }
  return x;
}

double residual_scale(std::span<const LineResidual> lines, const Vector6& x,
                      std::vector<double>& scratch) {
  constexpr double kSigmaPerMedian = 1.4826;
  if (lines.empty()) return 1;
  scratch.clear();
  for (const LineResidual& line : lines) {
    scratch.push_back(std::abs(line.by_pose.dot(x) - line.offset) / line.sigma);
  }
  const auto middle = scratch.begin() + static_cast<ptrdiff_t>(scratch.size() / 2);
  std::nth_element(scratch.begin(), middle, scratch.end());
  return kSigmaPerMedian * *middle;
}

}  // namespace sightline::observe
