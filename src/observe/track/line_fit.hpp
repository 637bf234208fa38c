// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "sightline/geometry/rigid3.hpp"

namespace sightline::observe {

/// One linear measurement of a pose's tangent: by_pose . x = offset, with standard deviation sigma.
struct LineResidual {
  Vector6 by_pose;
  double offset = 0;
  double sigma = 1;
};

/// The tangent x that minimizes  (x + at)^T prior (x + at) / 2 + sum of Huber((by_pose . x -
/// offset) / sigma), by iteratively re-weighted least squares. `at`: where the present pose lies
/// from the prior's.
Vector6 fit_lines(std::span<const LineResidual> lines, const Matrix6& prior, const Vector6& at,
                  double huber);

/// Robust scale of (by_pose . x - offset) / sigma: 1 for residuals as large as they claim. (Median
/// absolute deviation from zero.) `scratch` is reused.
double residual_scale(std::span<const LineResidual> lines, const Vector6& x,
                      std::vector<double>& scratch);

}  // namespace sightline::observe
