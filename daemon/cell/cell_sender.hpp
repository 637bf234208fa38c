// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "cell/cell_parts.hpp"
#include "sightline/base/bounded_queue.hpp"

namespace sightline {

/// What this host's cameras see, on its way to whoever fuses it. On the cell's thread, but for
/// push() and set_doubted().
class CellSender {
 public:
  CellSender(const CellParts& parts, const CellIdentity& self, Registry& registry);

  /// Takes one frame's observation, on the thread that made it: it is linearized there. Waits for
  /// nobody.
  void push(const Observation& observation);
  void set_doubted(ObjectId object, bool doubted) { doubted_.at(object.index()) = doubted; }
  /// Sends what waits; without a client it is let go. `on_seen` (may be empty) hears of objects
  /// that were seen.
  void send(MqttClient* client, const ClockWatch& clock, Time now,
            const std::function<void(ObjectId)>& on_seen = {});

 private:
  struct Item {
    CellObservation observation;
    ObjectId object;
    Time capture;
  };

  const CellParts& parts_;
  const CellIdentity self_;
  const CellTopics topics_;
  BoundedQueue<Item> queue_{256};
  std::vector<std::atomic<bool>> doubted_;  // by ObjectId
  uint64_t sequence_ = 0;
  Counter &sent_, &late_, &no_clock_, &no_broker_, &overflow_, &no_pose_;
};

}  // namespace sightline
