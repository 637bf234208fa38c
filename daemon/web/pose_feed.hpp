// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "sightline/base/counters.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/control/http_content.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// Names of a running system's objects and cameras, by id.
struct FeedNames {
  std::vector<std::string> objects, cameras;
  std::string calibration;  ///< hash of what is in force: another one, another world
};

/// The newest estimates on their way to clients: the estimator adds, each client reads at its own
/// pace. Who falls more than kKept behind misses what is in between, and is told how much. Any
/// thread.
class PoseFeed {
 public:
  PoseFeed(Registry& registry, std::shared_ptr<HttpWaker> waker);

  /// What ids mean from now on.
  void rename(FeedNames names) {
    names_.publish(std::make_shared<const FeedNames>(std::move(names)));
  }
  /// Is woken with every estimate, too.
  void add_waker(std::shared_ptr<HttpWaker> waker);
  void remove_waker(const std::shared_ptr<HttpWaker>& waker);
  /// On the estimator's thread; never waits, costs nothing without clients.
  void push(const PoseEstimate& estimate);

  struct Entry {
    PoseEstimate estimate;
    std::shared_ptr<const FeedNames> names;
  };
  static constexpr size_t kKept = 128;

  /// One client's place in the feed. One thread.
  class Reader {
   public:
    explicit Reader(std::shared_ptr<PoseFeed> feed);
    ~Reader();
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;
    bool ready() const { return feed_->pushed_ > next_; }
    /// Adds at most `most` to `out`; returns how many were missed since the last call.
    uint64_t read(std::vector<Entry>& out, size_t most);

   private:
    const std::shared_ptr<PoseFeed> feed_;
    uint64_t next_;
  };

 private:
  const std::shared_ptr<HttpWaker> waker_;
  Counter& missed_;
  Gauge& clients_gauge_;
  Snapshot<const FeedNames> names_;
  std::atomic<int> clients_{0};
  std::atomic<uint64_t> pushed_{0};
  std::mutex mutex_;  // guards the two below
  std::array<Entry, kKept> ring_;
  std::vector<std::shared_ptr<HttpWaker>> more_wakers_;
};

/// A client's server-sent events (docs/api.md): poses as they are estimated, and with `state_json`
/// the state once a second, on one line.
std::shared_ptr<HttpStream> make_event_stream(std::shared_ptr<PoseFeed> feed,
                                              std::function<std::string()> state_json);

}  // namespace sightline
