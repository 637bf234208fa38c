// SPDX-License-Identifier: Apache-2.0
#include "calibrate/report/correlations.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::calibrate {
namespace {

constexpr double kTelling = 0.9;

}  // namespace

std::vector<Correlation> telling_correlations(const SolvedCamera& solved) {
  std::vector<std::string> names;
  for (const ParameterEstimate& estimate : solved.estimates) names.push_back(estimate.name);
  if (solved.has_place) {
    for (const char* name : {"turn x", "turn y", "turn z", "place x", "place y", "place z"}) {
      names.emplace_back(name);
    }
  }
  std::vector<Correlation> found;
  for (size_t i = 0; i < names.size(); ++i) {
    for (size_t j = i + 1; j < names.size(); ++j) {
      const auto a = static_cast<Eigen::Index>(i), b = static_cast<Eigen::Index>(j);
      const double value =
          solved.covariance(a, b) / std::sqrt(solved.covariance(a, a) * solved.covariance(b, b));
      if (std::abs(value) >= kTelling) found.push_back({names[i], names[j], value});
    }
  }
  std::stable_sort(found.begin(), found.end(), [](const Correlation& x, const Correlation& y) {
    return std::abs(x.value) > std::abs(y.value);
  });
  return found;
}

}  // namespace sightline::calibrate
