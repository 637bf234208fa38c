// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>

#include "commands.hpp"
#include "daemon.hpp"
#include "recording/image_recording.hpp"
#include "report.hpp"
#include "sightline/base/log_output.hpp"
#include "signals.hpp"

namespace sightline::cli {
namespace {

struct RecordOptions {
  std::filesystem::path config;
  std::filesystem::path out;
  std::optional<double> seconds;  ///< stop by itself
};

using namespace std::chrono_literals;

// Until a signal, the asked time, the end of played recordings, or a disk that takes no more.
void wait_for_end(const Daemon& daemon, const Signals& signals, std::optional<double> seconds) {
  const Time start = MonotonicClock::now();
  for (;;) {
    if (signals.wait(100ms) != 0) return;
    if (seconds && MonotonicClock::now() - start >= from_seconds(*seconds)) return;
    (void)log::flush(0ms);
    if (daemon.ended() || !daemon.record_problem().empty()) return;
  }
}

// Of cameras that have no calibration yet: their images alone.
Status record_images(const Installation& installation, const RecordOptions& options,
                     const Signals& signals) {
  log::warning("{}: no calibration yet: images are recorded, without poses",
               options.config.string());
  SL_ASSIGN(const auto recording, ImageRecording::start(installation, options.out));
  const Time start = MonotonicClock::now();
  bool told = false;
  while (signals.wait(100ms) == 0) {
    const Duration elapsed = MonotonicClock::now() - start;
    (void)log::flush(0ms);
    if (options.seconds && elapsed >= from_seconds(*options.seconds)) break;
    if (recording->ended() || !recording->problem().empty()) break;
    if (!told && elapsed > 5s && recording->written() == 0) {
      log::warning("still waiting for the first image of {}", recording->waits_for());
      told = true;
    }
  }
  const Status done = recording->stop();
  if (recording->dropped() > 0) {
    log::warning("{} frames were left out: the disk is too slow", recording->dropped());
  }
  return done;
}

bool is_calibrated(const Installation& installation) {
  std::error_code ignored;
  return !installation.calibration.empty() &&
         std::filesystem::exists(installation.calibration, ignored);
}

Status record_until_end(const RecordOptions& options) {
  SL_ASSIGN(const Signals signals, Signals::create());
  if (const auto bare = read_uncalibrated_installation(options.config);
      bare && !is_calibrated(*bare)) {
    return record_images(*bare, options, signals);
  }
  SL_ASSIGN(Installation installation, read_installation(options.config));
  DaemonOptions daemon_options;
  daemon_options.record_to = options.out;
  daemon_options.serve = false;
  SL_ASSIGN(auto daemon, Daemon::start(std::move(installation), daemon_options));
  wait_for_end(*daemon, signals, options.seconds);
  return daemon->stop();
}

int record(const RecordOptions& options) {
  log::never_wait();  // a recording does not stand still for who reads the messages
  const Status done = record_until_end(options);
  (void)log::flush(1s);
  return done ? 0 : report(done.error());
}

}  // namespace

void add_record(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<RecordOptions>();
  auto* command = app.add_subcommand("record", "record an installation's cameras");
  command->add_option("--config", options->config, "installation file")->required();
  command->add_option("OUT", options->out, "folder to make")->required();
  command->add_option("--seconds", options->seconds, "stop after so long (default: Ctrl-C)")
      ->check(CLI::PositiveNumber);
  command->callback([options, &chosen] { chosen = [options] { return record(*options); }; });
}

}  // namespace sightline::cli
