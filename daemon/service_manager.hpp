// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "sightline/base/time.hpp"

namespace sightline {

/// Words to systemd (the protocol of sd_notify). Without systemd every call does nothing; if nobody
/// reads them, each gives up after a fifth of a second.
class ServiceManager {
 public:
  void ready(const std::string& status) const;
  void status(const std::string& status) const;
  void reloading() const;
  void stopping() const;
  void feed_watchdog() const;
  /// How often the watchdog wants to be fed at least; empty if there is none.
  std::optional<Duration> watchdog_period() const;
};

}  // namespace sightline
