// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <stop_token>

#include "heartbeat.hpp"
#include "sightline/base/time.hpp"
#include "workers/backoff.hpp"

namespace sightline {

inline void sleep_unless_stopped(const std::stop_token& stop, Duration duration) {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, stop, duration, [] { return false; });
}

/// Until the next attempt at a camera, in turns no longer than `turn`: waiting for it is progress.
inline void wait_to_reopen(const std::stop_token& stop, Heartbeat& heartbeat, Backoff& backoff,
                           Duration turn) {
  const Time end = MonotonicClock::now() + backoff.next();
  for (Time now = MonotonicClock::now(); now < end && !stop.stop_requested();
       now = MonotonicClock::now()) {
    heartbeat.beat();
    sleep_unless_stopped(stop, std::min<Duration>(end - now, turn));
  }
}

}  // namespace sightline
