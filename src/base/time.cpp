// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/time.hpp"

#include <ctime>

namespace sightline {
namespace {

int64_t read_clock(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

MonotonicClock::time_point MonotonicClock::now() {
  return time_from_ns(read_clock(CLOCK_MONOTONIC));
}

double process_cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

int64_t utc_now_ns() { return read_clock(CLOCK_REALTIME); }

int64_t utc_ns_of(Time time) {
  return read_clock(CLOCK_REALTIME) - (to_ns(MonotonicClock::now()) - to_ns(time));
}

}  // namespace sightline
