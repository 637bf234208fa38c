// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_orders.hpp"

#include "sightline/base/log.hpp"

namespace sightline {

using namespace std::chrono_literals;

CellOrders::CellOrders(const CellParts& parts, const CellIdentity& self, Registry& registry)
    : parts_(parts),
      self_(self),
      topics_(parts.options.name),
      counters_(cell_counters(registry, "order")),
      sent_(registry.counter("sightline_cell_orders_sent_total",
                             "Orders that were passed on to the other hosts")) {}

void CellOrders::send(MqttClient* client, const ClockWatch& clock, Time now) {
  if (client == nullptr) return;
  while (auto order = queue_.pop({}, 0ns)) {
    order->host = self_.host;
    order->boot = self_.boot;
    order->sequence = ++sequence_;
    order->time_utc_ns = clock.utc_ns_of(now);
    if (client->publish(order_topic(topics_, self_.host), encode(*order), false, 1)) {
      sent_.add();
    } else {
      log::error({.cause = "order"}, "cell: the other hosts were not told to {}: no broker",
                 to_string(order->kind));
    }
  }
}

CellVerdict CellOrders::judge(std::string_view topic, const CellOrder& order, int64_t now_utc_ns) {
  // The broker lets each host write its own topic alone.
  if (topic != order_topic(topics_, order.host)) return CellVerdict::kForeign;
  return gate_.check(order, now_utc_ns);
}

void CellOrders::on_message(std::string_view topic, std::string_view payload,
                            const ClockWatch& clock, Time now) {
  const auto order = decode_order(payload);
  if (order && order->boot == self_.boot && order->host == self_.host) return;
  const CellVerdict verdict =
      order ? judge(topic, *order, clock.utc_ns_of(now)) : CellVerdict::kMalformed;
  counters_[static_cast<size_t>(verdict)]->add();
  if (verdict == CellVerdict::kTaken) return parts_.on_order(*order);
  if (!order) return;
  log::warning({.cause = "order"}, "cell: an order of host {} ({}) is refused: {}", order->host,
               to_string(order->kind), to_string(verdict));
}

}  // namespace sightline
