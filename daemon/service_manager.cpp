// SPDX-License-Identifier: Apache-2.0
#include "service_manager.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <systemd/sd-daemon.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "sightline/base/log.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline {
namespace {

constexpr int kPatienceMs = 200;

// sd_notify() waits for ever while nobody reads the socket and its queue is full.
bool send_bounded(const char* path, const std::string& message) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const size_t length = std::strlen(path);
  if ((path[0] != '/' && path[0] != '@') || length >= sizeof address.sun_path) return false;
  std::memcpy(address.sun_path, path, length);
  if (path[0] == '@') address.sun_path[0] = 0;
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
  const UniqueFd fd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd.is_open() || ::connect(fd.get(), reinterpret_cast<sockaddr*>(&address), size) != 0) {
    return false;
  }
  const auto send = [&] {
    return ::send(fd.get(), message.data(), message.size(), MSG_NOSIGNAL) >= 0;
  };
  if (send()) return true;
  if (errno != EAGAIN) return false;
  pollfd writable{fd.get(), POLLOUT, 0};
  return ::poll(&writable, 1, kPatienceMs) > 0 && send();
}

void notify(const std::string& message) {
  const char* const path = std::getenv("NOTIFY_SOCKET");
  if (path == nullptr || *path == 0) return;
  if (!send_bounded(path, message)) log::debug("the service manager was not told: {}", message);
}

}  // namespace

void ServiceManager::ready(const std::string& status) const { notify("READY=1\nSTATUS=" + status); }

void ServiceManager::status(const std::string& status) const { notify("STATUS=" + status); }

void ServiceManager::reloading() const {
  // MONOTONIC_USEC lets Type=notify-reload (systemd 253) work too.
  const auto now_us = to_ns(MonotonicClock::now()) / 1000;
  notify(fmt::format("RELOADING=1\nMONOTONIC_USEC={}", now_us));
}

void ServiceManager::stopping() const { notify("STOPPING=1"); }

void ServiceManager::feed_watchdog() const { notify("WATCHDOG=1"); }

std::optional<Duration> ServiceManager::watchdog_period() const {
  uint64_t period_us = 0;
  if (sd_watchdog_enabled(0, &period_us) <= 0) return std::nullopt;
  return std::chrono::microseconds(static_cast<int64_t>(period_us));
}

}  // namespace sightline
