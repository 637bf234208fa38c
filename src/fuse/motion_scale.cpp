// SPDX-License-Identifier: Apache-2.0
#include "motion_scale.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace sightline::fuse {
namespace {

constexpr double kGain = 0.1;  // of the logarithm, per fully informative update
constexpr double kMaxGrowth = 1.0;
constexpr double kMinScale = 0.0025;  // a twentieth of the nominal acceleration
constexpr double kMaxScale = 4.0;

}  // namespace

// The offset from a right prediction has the covariance P - P_posterior, so the expectation of
// offset^T P^-1 offset is tr(I - P^-1 P_posterior).
Surprise measure_surprise(const PoseMinimum& minimum) {
  const Matrix6 kept = minimum.information().ldlt().solve(minimum.prior_information);
  return {2.0 * minimum.prior_cost, 6.0 - kept.trace()};
}

void adapt_motion(const Surprise& surprise, Hypothesis& hypothesis) {
  const double step = kGain / 6.0 * (surprise.squared - surprise.dof);
  hypothesis.motion_scale = std::clamp(
      hypothesis.motion_scale * std::exp(std::min(step, kMaxGrowth)), kMinScale, kMaxScale);
}

void calm_is_over(Hypothesis& hypothesis) {
  hypothesis.motion_scale = std::max(1.0, hypothesis.motion_scale);
}

}  // namespace sightline::fuse
