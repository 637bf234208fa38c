// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <csignal>

#include "commands.hpp"
#include "daemon.hpp"
#include "report.hpp"
#include "sightline/base/log.hpp"
#include "signals.hpp"

namespace sightline::cli {
namespace {

using namespace std::chrono_literals;

// Until a signal, the asked time, the end of played recordings, or a disk that takes no more.
void wait_for_end(const Daemon& daemon, const Signals& signals, std::optional<double> seconds) {
  const Time start = MonotonicClock::now();
  for (;;) {
    if (signals.wait(100ms) != 0) return;
    if (seconds && MonotonicClock::now() - start >= from_seconds(*seconds)) return;
    if (daemon.ended() || !daemon.record_problem().empty()) return;
  }
}

Status record_until_end(const RecordOptions& options) {
  SL_ASSIGN(const Signals signals, Signals::create());
  SL_ASSIGN(Installation installation, read_installation(options.config));
  DaemonOptions daemon_options;
  daemon_options.record_to = options.out;
  daemon_options.serve = false;
  SL_ASSIGN(auto daemon, Daemon::start(std::move(installation), daemon_options));
  wait_for_end(*daemon, signals, options.seconds);
  return daemon->stop();
}

}  // namespace

int record(const RecordOptions& options) {
  const Status done = record_until_end(options);
  return done ? 0 : report(done.error());
}

}  // namespace sightline::cli
