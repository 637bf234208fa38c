// SPDX-License-Identifier: Apache-2.0
#include "cell/clock_service.hpp"

#include <array>
#include <cstdio>

#include "sightline/publish/cell/clock_watch.hpp"
#include "workers/wait_to_reopen.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 200ms, kEvery = 4s;
constexpr Duration kStallLimit = 10s;  // besides what it waits for the service
constexpr int kNoSuchProgram = 127;

// `timeout` since a service that hangs would hold up the end of the daemon.
ClockService::Reading ask_chrony() {
  const Waiting wait("the time service");
  FILE* pipe = ::popen("timeout 2 chronyc -c tracking 2>/dev/null", "re");
  if (pipe == nullptr) return {};
  std::array<char, 1024> line{};
  const size_t size = std::fread(line.data(), 1, line.size(), pipe);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNoSuchProgram) return {};
  ClockService::Reading reading{chrony_bound({line.data(), size}), ""};
  if (!reading.bound) reading.problem = "chrony is in step with no server";
  return reading;
}

}  // namespace

ClockService::ClockService(HeartbeatBoard& beats)
    : thread_(start_watched_thread(
          beats, "clock", kStallLimit,
          [this](std::stop_token stop, Heartbeat& beat) { run(stop, beat); })) {}

void ClockService::run(const std::stop_token& stop, Heartbeat& heartbeat) {
  Time next{};
  while (!stop.stop_requested()) {
    heartbeat.beat();
    if (MonotonicClock::now() >= next) {
      reading_.publish(std::make_shared<const Reading>(ask_chrony()));
      next = MonotonicClock::now() + kEvery;
    }
    sleep_unless_stopped(stop, kTurn);
  }
}

}  // namespace sightline
