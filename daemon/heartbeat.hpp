// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/base/waiting.hpp"

namespace sightline {

/// Proof that one thread makes progress. beat() is wait-free; call it in every turn of a loop, also
/// when there was nothing to do (a lost camera is not a hung daemon).
///
/// A thread that waits for a device or a disk (Waiting) is not stalled, however long that takes:
/// starting the service again would not make the disk any faster. It is reported instead.
class Heartbeat final : public WaitListener {
 public:
  Heartbeat(std::string name, Duration limit) : name_(std::move(name)), limit_(limit) { beat(); }
  void beat() { last_.store(MonotonicClock::now(), std::memory_order_relaxed); }
  /// The thread has ended as it should; its silence means nothing any more.
  void retire() { retired_.store(true, std::memory_order_relaxed); }

  void wait_begins(const char* what) override;
  void wait_ends() override;

  /// The thread has left its body, as it should or by an exception; any thread.
  void end();
  /// Whether it has, after at most so long.
  bool wait_for_end(Duration patience) const;

  const std::string& name() const { return name_; }
  bool stalled(Time now) const;
  bool retired() const { return retired_.load(std::memory_order_relaxed); }

  struct Wait {
    const char* what;  ///< "the disk"
    Time since;
  };
  /// What the thread waits for at this moment, if anything.
  std::optional<Wait> wait() const;

 private:
  const std::string name_;
  const Duration limit_;
  std::atomic<Time> last_{}, waiting_since_{};
  std::atomic<const char*> waits_for_{nullptr};
  std::atomic<bool> retired_{false};
  mutable std::mutex mutex_;
  mutable std::condition_variable ended_changed_;
  bool ended_ = false;  // guarded by mutex_
};

/// A thread that waits for a device or a disk.
struct ThreadWait {
  std::string thread;
  std::string what;  ///< "the disk"
  Time since{};
};

/// The heartbeats of all threads that run. Any thread.
class HeartbeatBoard {
 public:
  std::shared_ptr<Heartbeat> add(std::string name, Duration limit);
  /// Names of the threads that made no progress within their limit.
  std::vector<std::string> stalled(Time now) const;
  /// Threads that have been waiting for a device or a disk for `least` or longer.
  std::vector<ThreadWait> waits(Time now, Duration least) const;
  /// Of threads that have not retired.
  size_t size() const;

 private:
  mutable std::mutex mutex_;
  std::vector<std::shared_ptr<Heartbeat>> beats_;
};

/// A thread with a heartbeat that may have to be left behind. Default: none. One thread at a time.
class WatchedThread {
 public:
  WatchedThread() = default;
  /// See start_watched_thread().
  WatchedThread(HeartbeatBoard& beats, const std::string& name, Duration limit,
                std::function<void(std::stop_token, Heartbeat&)> body);

  void request_stop() { thread_.request_stop(); }
  bool joinable() const { return thread_.joinable(); }
  void join() { thread_.join(); }
  /// Same, but once `patience` has passed a thread that waits for a device or a disk is left to
  /// itself: false then. Where it runs code of ours instead it is waited for. Requests no stop.
  bool join_unless_waiting(Duration patience);
  const Heartbeat& heartbeat() const { return *beat_; }
  /// The thread itself; its heartbeat goes on.
  std::jthread release() { return std::move(thread_); }

 private:
  std::shared_ptr<Heartbeat> beat_;
  std::jthread thread_;
};

/// Starts a named thread with a heartbeat, which retires when `body` returns; one that is ended by
/// an exception falls silent instead.
std::jthread start_watched_thread(HeartbeatBoard& beats, const std::string& name, Duration limit,
                                  std::function<void(std::stop_token, Heartbeat&)> body);

}  // namespace sightline
