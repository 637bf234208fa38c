// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <random>
#include <string>

#include "sightline/base/time.hpp"

namespace sightline {

/// How long to wait before the next attempt at something that is not there: twice as long each
/// time, from 0.2 to 0.8 s, give or take a quarter, so that cameras that went together do not come
/// back at the same instant. Bounded so that a camera that returns is seen within a second.
class Backoff {
 public:
  explicit Backoff(const std::string& name)
      : random_(static_cast<uint32_t>(std::hash<std::string>()(name) | 1)) {}

  Duration next() {
    const double share = std::uniform_real_distribution<double>(0.75, 1.25)(random_);
    const Duration wait = from_seconds(to_seconds(step_) * share);
    step_ = std::min<Duration>(step_ * 2, kLongest);
    return wait;
  }
  /// It is there.
  void reset() { step_ = kFirst; }

 private:
  static constexpr Duration kFirst = std::chrono::milliseconds(200);
  static constexpr Duration kLongest = std::chrono::milliseconds(800);

  std::minstd_rand random_;
  Duration step_ = kFirst;
};

}  // namespace sightline
