// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace sightline::observe {

/// What is best at other places than the best pose: in clutter many are as good. Of as many of them
/// as objects are missing that look the same, nothing follows: they may be those.
class RivalPlaces {
 public:
  /// `apart`: two poses whose middles are farther apart are at two places [m].
  RivalPlaces(double apart, size_t alike) : apart_(apart), alike_(alike) {}

  void add(const Eigen::Vector3d& center, double score);
  /// The most of those that remain; 0: none do.
  double strongest() const;

 private:
  struct Place {
    Eigen::Vector3d center;
    double score = 0;
  };
  const double apart_;
  const size_t alike_;
  std::vector<Place> places_;  ///< best first
};

}  // namespace sightline::observe
