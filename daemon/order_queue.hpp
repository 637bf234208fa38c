// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>

#include "sightline/control/http_content.hpp"

namespace sightline {

/// Orders over HTTP that need a disk or take a moment. They are done one after another on the
/// control thread, between reloads, while their clients wait and the HTTP thread does not.
class OrderQueue {
 public:
  using Work = std::function<HttpReply()>;

  /// `tell`: there is work; called on the thread of take(), must not wait.
  OrderQueue(std::function<void()> tell, std::shared_ptr<HttpWaker> waker)
      : tell_(std::move(tell)), waker_(std::move(waker)) {}

  /// The reply comes later. Refused while kMost wait. Any thread, never waits.
  HttpReply take(Work work);
  /// Does what has been ordered so far. One thread.
  void work();

  static constexpr size_t kMost = 16;

 private:
  struct Order;
  const std::function<void()> tell_;
  const std::shared_ptr<HttpWaker> waker_;
  std::mutex mutex_;  // guards waiting_
  std::deque<std::shared_ptr<Order>> waiting_;
};

}  // namespace sightline
