// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "calibrate/axes/head_problem.hpp"

namespace sightline::calibrate {

/// Least squares with Ceres for the noises and weights that the problem has. False where it does
/// not converge.
bool adjust(HeadProblem& problem, int max_iterations);

/// Where the parameters of a problem are in its covariance: those of AxesParameter first (-1:
/// held), then lenses and bodies.
struct HeadLayout {
  std::array<int, kAxesParameters> axes{};
  std::vector<std::vector<int>> lens;  ///< by lens and parameter (0..11): column, or -1
  std::vector<int> body;               ///< by body: first of six, or -1
  int size = 0;
};
HeadLayout layout_of(const HeadProblem& problem);

/// What the linearized problem says of itself. The errors of the readings are marginalized.
struct HeadCovariance {
  HeadLayout layout;
  Eigen::MatrixXd matrix;  ///< of the layout; empty: something is not determined
  double chi2 = 0;         ///< of the whole problem, in units of its noises
  double freedom = 0;      ///< observations less unknowns
  /// Of Helmert's variance components, by which each should be multiplied: corners at
  /// rest and in motion, readings, and the part of these that grows with the rate.
  double corners = 1, moving = 1, readings = 1, jitter = 1;
  double redundancy_readings = 0, redundancy_jitter = 0;  ///< by how much each is determined
};
HeadCovariance head_covariance(const HeadProblem& problem);

}  // namespace sightline::calibrate
