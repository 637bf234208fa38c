// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "cell/cell_parts.hpp"
#include "sightline/base/bounded_queue.hpp"
#include "sightline/publish/cell/cell_order.hpp"
#include "sightline/publish/mqtt.hpp"

namespace sightline {

/// Orders of operators, to the other hosts and from them. On the cell's thread, but for push().
class CellOrders {
 public:
  CellOrders(const CellParts& parts, const CellIdentity& self, Registry& registry);

  /// One that was given at this host; any thread, never waits.
  void push(CellOrder order) { (void)queue_.push(std::move(order)); }
  /// Sends what waits; without a client it waits on, until it is too old.
  void send(MqttClient* client, const ClockWatch& clock, Time now);
  void on_message(std::string_view topic, std::string_view payload, const ClockWatch& clock,
                  Time now);

 private:
  CellVerdict judge(std::string_view topic, const CellOrder& order, int64_t now_utc_ns);

  const CellParts& parts_;
  const CellIdentity self_;
  const CellTopics topics_;
  BoundedQueue<CellOrder> queue_{64};
  OrderGate gate_;
  uint64_t sequence_ = 0;
  CellCounters counters_;
  Counter& sent_;
};

}  // namespace sightline
