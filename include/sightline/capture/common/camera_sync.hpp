// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "sightline/base/time.hpp"

namespace sightline {

/// One frame's time on a clock that both cameras share, and the bound of its error.
struct SyncStamp {
  Time time{};
  Duration error{0};
};

/// How two cameras expose relative to each other.
struct SyncReport {
  double rate_a_hz = 0, rate_b_hz = 0;
  size_t frames_a = 0, frames_b = 0;
  size_t pairs = 0;   ///< frames of A with a neighbor of B
  Duration phase{0};  ///< how much later than A does B expose, at the end; within half a period
  Duration phase_error{0};
  double drift = 0;  ///< growth of the phase per time; 10e-6: 10 us each second
  double drift_error = 0;
  Duration jitter{0};  ///< standard deviation of the phase about its line
};

/// From the times of frames, each in order. Each frame of A is paired with the nearest of B; a line
/// through the differences (unwrapped at half a period) by the median of pairwise slopes (Theil and
/// Sen) gives phase and drift. Needs 5 pairs, else only counts and rates are filled. Any thread.
SyncReport measure_sync(std::span<const SyncStamp> a, std::span<const SyncStamp> b);

}  // namespace sightline
