// SPDX-License-Identifier: Apache-2.0
#include "heartbeat.hpp"

namespace sightline {

Heartbeat& HeartbeatBoard::add(std::string name, Duration limit) {
  std::lock_guard lock(mutex_);
  return beats_.emplace_back(std::move(name), limit);
}

std::vector<std::string> HeartbeatBoard::stalled(Time now) const {
  std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const Heartbeat& beat : beats_) {
    if (beat.stalled(now)) names.push_back(beat.name());
  }
  return names;
}

}  // namespace sightline
