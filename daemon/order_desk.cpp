// SPDX-License-Identifier: Apache-2.0
#include "order_desk.hpp"

#include <exception>
#include <optional>

#include "sightline/base/log.hpp"

namespace sightline {

struct OrderDesk::Order {
  Work work;
  std::mutex mutex;  // guards reply
  std::optional<HttpReply> reply;
};

HttpReply OrderDesk::take(Work work) {
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

void OrderDesk::work() {
  for (;;) {
    std::shared_ptr<Order> order;
    {
      const std::lock_guard lock(mutex_);
      if (waiting_.empty()) return;
      order = std::move(waiting_.front());
      waiting_.pop_front();
    }
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
