// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>

#include "sightline/base/time.hpp"

namespace sightline {

/// Hand-over that keeps order and drops the *oldest* when full, counted. push() never waits.
template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(size_t capacity) : capacity_(capacity) {}

  /// Appends `value`; returns the oldest entry if it had to go for it.
  std::optional<T> push(T value) {
    std::optional<T> dropped;
    {
      std::lock_guard lock(mutex_);
      if (values_.size() >= capacity_) {
        dropped.emplace(std::move(values_.front()));
        values_.pop_front();
        ++dropped_;
      }
      values_.push_back(std::move(value));
      peak_ = std::max(peak_, values_.size());
    }
    ready_.notify_one();
    return dropped;
  }

  /// The oldest entry, waiting at most `timeout`; empty on timeout or stop.
  std::optional<T> pop(std::stop_token stop, Duration timeout) {
    std::unique_lock lock(mutex_);
    ready_.wait_for(lock, stop, timeout, [this] { return !values_.empty(); });
    if (values_.empty()) return std::nullopt;
    std::optional<T> value(std::move(values_.front()));
    values_.pop_front();
    return value;
  }

  size_t size() const {
    std::lock_guard lock(mutex_);
    return values_.size();
  }
  /// The most that waited at once since the last call.
  size_t take_peak() {
    std::lock_guard lock(mutex_);
    return std::exchange(peak_, values_.size());
  }
  uint64_t dropped() const {
    std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  const size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable_any ready_;
  std::deque<T> values_;
  uint64_t dropped_ = 0;
  size_t peak_ = 0;
};

}  // namespace sightline
