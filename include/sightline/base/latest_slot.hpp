// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>

#include "sightline/base/time.hpp"

namespace sightline {

/// Hand-over between two threads where the newest wins: put() never waits, and a value that was not
/// taken in time is replaced and counted. Safe for any number of threads.
template <typename T>
class LatestSlot {
 public:
  /// Stores `value`; returns true if an older value was dropped for it.
  bool put(T value) {
    std::optional<T> replaced;  // destroyed outside the lock
    {
      std::lock_guard lock(mutex_);
      replaced = std::exchange(value_, std::optional<T>(std::move(value)));
      if (replaced) ++dropped_;
    }
    ready_.notify_one();
    return replaced.has_value();
  }

  /// The value, waiting at most `timeout` for one; empty on timeout or stop.
  std::optional<T> take(std::stop_token stop, Duration timeout) {
    std::unique_lock lock(mutex_);
    ready_.wait_for(lock, stop, timeout, [this] { return value_.has_value(); });
    return std::exchange(value_, std::nullopt);
  }

  uint64_t dropped() const {
    std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable_any ready_;
  std::optional<T> value_;
  uint64_t dropped_ = 0;
};

}  // namespace sightline
