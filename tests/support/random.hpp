// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace sightline::test {

/// Repeatable random numbers, the same on every platform (the distributions of <random> are not).
/// Generator: splitmix64 (Steele, Lea, Flood, 2014).
class Random {
 public:
  /// Neighboring seeds give unrelated sequences.
  explicit Random(uint64_t seed) : state_(seed) { state_ = bits() ^ 0xD1B54A32D192ED03ull; }

  uint64_t bits() {
    uint64_t z = (state_ += 0x9E3779B97F4A7C15ull);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  /// In (0, 1).
  double uniform() { return (static_cast<double>(bits() >> 11) + 0.5) * 0x1.0p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  template <int N>
  Eigen::Matrix<double, N, 1> normal() {
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i) v[i] = normal();
    return v;
  }

 private:
  uint64_t state_;
};

}  // namespace sightline::test
