// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <thread>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/config/installation.hpp"

namespace sightline {

/// Sends action commands to GigE Vision cameras at a steady rate, on a thread of its own, so that a
/// group of cameras exposes together. A network that is away is reported once, and tried for ever.
class ActionWorker {
 public:
  static std::unique_ptr<ActionWorker> start(const ActionConfig& config, Registry& registry,
                                             HeartbeatBoard& beats);
  ~ActionWorker() { stop(); }
  void stop() {
    thread_.request_stop();
    if (thread_.joinable()) thread_.join();
  }

 private:
  ActionWorker() = default;
  std::jthread thread_;
};

}  // namespace sightline
