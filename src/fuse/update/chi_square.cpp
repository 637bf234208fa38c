// SPDX-License-Identifier: Apache-2.0
#include "fuse/update/chi_square.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline::fuse {
namespace {

// log Gamma(dof / 2 + 1), by recursion: std::lgamma writes a global and is no friend of threads.
double log_gamma_half_plus_one(int dof) {
  double result = dof % 2 == 0 ? 0.0 : 0.5 * std::log(std::numbers::pi);
  for (double a = dof % 2 == 0 ? 1.0 : 0.5; a <= 0.5 * dof; a += 1.0) result += std::log(a);
  return result;
}

double normal_cdf(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

template <typename Cdf>
double bisect(const Cdf& cdf, double probability, double low, double high) {
  for (int i = 0; i < 200 && high - low > 1e-13 * (1.0 + std::abs(high)); ++i) {
    const double middle = 0.5 * (low + high);
    (cdf(middle) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double normal_quantile(double probability) { return bisect(normal_cdf, probability, -40.0, 40.0); }

// Wilson and Hilferty, 1931.
double wilson_hilferty(double z, int dof) {
  const double c = 2.0 / (9.0 * dof);
  const double root = std::max(0.0, 1.0 - c + z * std::sqrt(c));
  return dof * root * root * root;
}

}  // namespace

double chi_square_cdf(double x, int dof) {
  if (x <= 0) return 0;
  if (x > 600 || dof > 400) {  // the series below would overflow
    const double c = 2.0 / (9.0 * dof);
    return normal_cdf((std::cbrt(x / dof) - 1.0 + c) / std::sqrt(c));
  }
  // Series of the lower incomplete gamma function, P(a, x/2).
  const double half = 0.5 * x;
  double term = 1.0;
  double sum = 1.0;
  for (int n = 1; n < 5000 && term > 1e-17 * sum; ++n) {
    term *= half / (0.5 * dof + n);
    sum += term;
  }
  return std::min(1.0,
                  sum * std::exp(0.5 * dof * std::log(half) - half - log_gamma_half_plus_one(dof)));
}

double chi_square_quantile(double probability, int dof) {
  if (dof > 60) return wilson_hilferty(normal_quantile(probability), dof);
  return bisect([dof](double x) { return chi_square_cdf(x, dof); }, probability, 0.0, 500.0);
}

ChiSquareTable::ChiSquareTable(double probability)
    : normal_quantile_(normal_quantile(probability)) {
  for (int dof = 1; dof <= kExact; ++dof) {
    exact_[static_cast<size_t>(dof)] = chi_square_quantile(probability, dof);
  }
}

double ChiSquareTable::at(int dof) const {
  return dof <= kExact ? exact_[static_cast<size_t>(std::max(dof, 0))]
                       : wilson_hilferty(normal_quantile_, dof);
}

}  // namespace sightline::fuse
