// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>

namespace sightline {

/// Nanoseconds of CLOCK_MONOTONIC. Recordings and tests use the same type on a virtual clock.
struct MonotonicClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<MonotonicClock>;
  static constexpr bool is_steady = true;
  static time_point now();
};

using Time = MonotonicClock::time_point;
using Duration = MonotonicClock::duration;

constexpr int64_t to_ns(Time time) { return time.time_since_epoch().count(); }
constexpr Time time_from_ns(int64_t ns) { return Time(Duration(ns)); }
constexpr double to_seconds(Duration duration) {
  return static_cast<double>(duration.count()) * 1e-9;
}
constexpr Duration from_seconds(double seconds) {
  return Duration(static_cast<int64_t>(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5)));
}

/// CPU time of the process so far, all threads [ms]; for figures and summaries.
double process_cpu_ms();

/// UTC (CLOCK_REALTIME) nanoseconds now; only for the wire and for file names.
int64_t utc_now_ns();

/// UTC nanoseconds that belong to a monotonic time, by the offset of the two clocks now.
int64_t utc_ns_of(Time time);

}  // namespace sightline
