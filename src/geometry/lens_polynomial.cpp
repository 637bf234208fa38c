// SPDX-License-Identifier: Apache-2.0
#include "geometry/lens_polynomial.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace sightline::geometry {
namespace {

using Polynomial = std::vector<double>;  // lowest power first

template <typename Coefficients>
double evaluate(const Coefficients& p, double u) {
  double sum = 0;
  for (size_t i = p.size(); i-- > 0;) sum = sum * u + p[i];
  return sum;
}

template <typename Coefficients>
double evaluate_derivative(const Coefficients& p, double u) {
  double sum = 0;
  for (size_t i = p.size(); i-- > 1;) sum = sum * u + static_cast<double>(i) * p[i];
  return sum;
}

Polynomial derivative(const Polynomial& p) {
  Polynomial d;
  for (size_t i = 1; i < p.size(); ++i) d.push_back(static_cast<double>(i) * p[i]);
  return d;
}

Polynomial product(const Polynomial& a, const Polynomial& b) {
  Polynomial out(a.size() + b.size() - 1, 0.0);
  for (size_t i = 0; i < a.size(); ++i) {
    for (size_t j = 0; j < b.size(); ++j) out[i + j] += a[i] * b[j];
  }
  return out;
}

double bisect(const Polynomial& p, double low, double high) {
  const bool low_positive = evaluate(p, low) > 0;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    ((evaluate(p, middle) > 0) == low_positive ? low : high) = middle;
  }
  return low;
}

/// Where the sign of p changes in (0, limit), ascending. Between two neighboring extrema p is
/// monotone, so the sign changes of p are isolated by those of its derivative.
std::vector<double> sign_changes(const Polynomial& p, double limit) {
  if (p.size() <= 1) return {};
  std::vector<double> knots = sign_changes(derivative(p), limit);
  knots.insert(knots.begin(), 0.0);
  knots.push_back(limit);
  std::vector<double> roots;
  for (size_t i = 0; i + 1 < knots.size(); ++i) {
    if ((evaluate(p, knots[i]) > 0) != (evaluate(p, knots[i + 1]) > 0)) {
      roots.push_back(bisect(p, knots[i], knots[i + 1]));
    }
  }
  return roots;
}

}  // namespace

double RadialProfile::distorted(double r) const {
  const double u = r * r;
  return r * evaluate(numerator, u) / evaluate(denominator, u);
}

double RadialProfile::slope(double r) const {
  const double u = r * r;
  const double n = evaluate(numerator, u);
  const double d = evaluate(denominator, u);
  return (n +
          2 * u *
              (evaluate_derivative(numerator, u) - n * evaluate_derivative(denominator, u) / d)) /
         d;
}

double fold_over_radius(const RadialProfile& profile, double limit) {
  const Polynomial n(profile.numerator.begin(), profile.numerator.end());
  const Polynomial d(profile.denominator.begin(), profile.denominator.end());
  // Numerator of the slope in u:  (N + 2u N') D - 2u N D'.
  const Polynomial two_u{0, 2};
  Polynomial growth = product(two_u, derivative(n));
  for (size_t i = 0; i < n.size(); ++i) growth[i] += n[i];
  growth = product(growth, d);
  const Polynomial loss = product(product(two_u, n), derivative(d));
  for (size_t i = 0; i < loss.size(); ++i) growth[i] -= loss[i];

  double first = limit * limit;
  for (const Polynomial& p : {growth, d}) {
    const std::vector<double> roots = sign_changes(p, limit * limit);
    if (!roots.empty()) first = std::min(first, roots.front());
  }
  return std::sqrt(first);
}

double invert_profile(const RadialProfile& profile, double target, double limit, double tolerance) {
  double low = 0;
  double high = limit;
  if (!(target > 0)) return 0;
  if (!(profile.distorted(high) > target)) return high;
  double r = std::min(target, 0.5 * limit);
  for (int i = 0; i < 100; ++i) {
    const double error = profile.distorted(r) - target;
    if (std::abs(error) <= tolerance * target) break;
    (error > 0 ? high : low) = r;
    double next = r - error / profile.slope(r);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == r) break;
    r = next;
  }
  return r;
}

}  // namespace sightline::geometry
