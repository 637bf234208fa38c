// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "heartbeat.hpp"
#include "sightline/base/snapshot.hpp"

namespace sightline {

/// The thread ("clock") that asks chrony every few seconds how far this host's UTC may be off.
class ClockService {
 public:
  struct Reading {
    std::optional<Duration> bound;  ///< nullopt: there is no chrony, or it is in step with nobody
    std::string problem;            ///< empty: none, or there is no chrony
  };
  explicit ClockService(HeartbeatBoard& beats);
  /// Null before the first answer. Any thread.
  std::shared_ptr<const Reading> reading() const { return reading_.read(); }

 private:
  void run(const std::stop_token& stop, Heartbeat& heartbeat);
  Snapshot<const Reading> reading_;
  std::jthread thread_;
};

}  // namespace sightline
