// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace sightline::fuse {

/// Probability that a chi-square variable of `dof` degrees of freedom is at most `x`.
double chi_square_cdf(double x, int dof);

/// The x with chi_square_cdf(x, dof) = probability. dof >= 1, 0 < probability < 1. Exact to 1e-9
/// up to 60 degrees of freedom, the Wilson-Hilferty approximation (better than 0.1 %) above.
double chi_square_quantile(double probability, int dof);

/// Quantiles of one probability for many dof, without work in the hot path.
class ChiSquareTable {
 public:
  explicit ChiSquareTable(double probability);
  double at(int dof) const;

 private:
  static constexpr int kExact = 60;
  double normal_quantile_;
  std::array<double, kExact + 1> exact_{};
};

}  // namespace sightline::fuse
