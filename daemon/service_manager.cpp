// SPDX-License-Identifier: Apache-2.0
#include "service_manager.hpp"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

namespace sightline {

void ServiceManager::ready(const std::string& status) const {
  sd_notify(0, ("READY=1\nSTATUS=" + status).c_str());
}

void ServiceManager::status(const std::string& status) const {
  sd_notify(0, ("STATUS=" + status).c_str());
}

void ServiceManager::reloading() const {
  // MONOTONIC_USEC lets Type=notify-reload (systemd 253) work too.
  const auto now_us = to_ns(MonotonicClock::now()) / 1000;
  sd_notify(0, fmt::format("RELOADING=1\nMONOTONIC_USEC={}", now_us).c_str());
}

void ServiceManager::stopping() const { sd_notify(0, "STOPPING=1"); }

void ServiceManager::feed_watchdog() const { sd_notify(0, "WATCHDOG=1"); }

std::optional<Duration> ServiceManager::watchdog_period() const {
  uint64_t period_us = 0;
  if (sd_watchdog_enabled(0, &period_us) <= 0) return std::nullopt;
  return std::chrono::microseconds(static_cast<int64_t>(period_us));
}

}  // namespace sightline
