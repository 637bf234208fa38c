// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <utility>

namespace sightline {

/// The newest version of a value that one side publishes and others read, each for as long as it
/// needs; null before the first. Any thread.
template <class T>
class Snapshot {
 public:
  void publish(std::shared_ptr<T> value) {
    std::lock_guard lock(mutex_);
    value_.swap(value);  // the one before is destroyed outside the lock
  }
  std::shared_ptr<T> read() const {
    std::lock_guard lock(mutex_);
    return value_;
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<T> value_;
};

}  // namespace sightline
