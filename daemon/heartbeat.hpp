// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

#include "sightline/base/time.hpp"

namespace sightline {

/// Proof that one thread makes progress. beat() is wait-free; call it in every turn of a loop, also
/// when there was nothing to do (a lost camera is not a hung daemon).
class Heartbeat {
 public:
  Heartbeat(std::string name, Duration limit) : name_(std::move(name)), limit_(limit) { beat(); }
  void beat() { last_.store(MonotonicClock::now(), std::memory_order_relaxed); }
  /// The thread has ended as it should; its silence means nothing any more.
  void retire() { retired_.store(true, std::memory_order_relaxed); }

  const std::string& name() const { return name_; }
  bool stalled(Time now) const {
    return !retired_.load(std::memory_order_relaxed) &&
           now - last_.load(std::memory_order_relaxed) > limit_;
  }
  bool retired() const { return retired_.load(std::memory_order_relaxed); }

 private:
  const std::string name_;
  const Duration limit_;
  std::atomic<Time> last_{};
  std::atomic<bool> retired_{false};
};

/// All heartbeats of the process.
class HeartbeatBoard {
 public:
  /// The returned reference stays valid for the board's life.
  Heartbeat& add(std::string name, Duration limit);
  /// Names of the threads that made no progress within their limit.
  std::vector<std::string> stalled(Time now) const;

 private:
  mutable std::mutex mutex_;
  std::deque<Heartbeat> beats_;
};

}  // namespace sightline
