// SPDX-License-Identifier: Apache-2.0
#include "order_queue.hpp"

#include <exception>
#include <optional>

#include "sightline/base/log.hpp"

namespace sightline {

struct OrderQueue::Order {
  Work work;
  std::mutex mutex;  // guards reply
  std::optional<HttpReply> reply;
};

HttpReply OrderQueue::take(Work work) {
  const auto order = std::make_shared<Order>();
  order->work = std::move(work);
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= kMost) {
      return HttpReply::error(503, "other orders are still being done; try again");
    }
    waiting_.push_back(order);
  }
  tell_();
  HttpReply reply;
  reply.later = [order] {
    const std::lock_guard lock(order->mutex);
    return order->reply;
  };
  return reply;
}

void OrderQueue::work() {
  std::deque<std::shared_ptr<Order>> orders;  // of what comes meanwhile tell_() speaks again
  {
    const std::lock_guard lock(mutex_);
    orders.swap(waiting_);
  }
  for (const std::shared_ptr<Order>& order : orders) {
    HttpReply reply;
    try {
      reply = order->work();
    } catch (const std::exception& exception) {
      log::error("an order failed: {}", exception.what());
      reply = HttpReply::error(500, "failed; the log says why");
    }
    {
      const std::lock_guard lock(order->mutex);
      order->reply = std::move(reply);
    }
    waker_->wake();
  }
}

}  // namespace sightline
