// SPDX-License-Identifier: Apache-2.0
// `sightlined`: reads the installation, runs it, and answers signals and the service manager.
#include <malloc.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>
#include <string>

#include "control_thread.hpp"
#include "service_manager.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/log_history.hpp"
#include "sightline/base/log_output.hpp"
#include "sightline/pipeline/file_check.hpp"
#include "signals.hpp"
#include "version.hpp"

namespace {

using namespace sightline;
using namespace std::chrono_literals;

constexpr Duration kPatience = 1800ms;  // with a stop that takes longer
constexpr size_t kEventsKept = 200;     // for who opens the page later
constexpr Duration kLogPatience = 1s;   // with who reads the log, at the end

int fail(const Error& error) {
  log::error("{}", error.message());
  return exit_code(error);
}

// The service manager is told READY once for every start and reload that has come to its end.
class Announcer {
 public:
  explicit Announcer(const ServiceManager& manager) : manager_(manager) {}
  void reloading() {
    if (!due_ && started_) manager_.reloading();
    due_ = true;
  }
  void tell(const ControlThread& control) {
    const auto daemon = control.daemon();
    if (!daemon) return;
    const std::string status = daemon->status_line();
    if (due_ && !control.busy()) {
      due_ = false;
      started_ = true;
      manager_.ready(status);
    } else if (status != last_ && started_) {
      manager_.status(status);
    }
    last_ = status;
  }

 private:
  const ServiceManager& manager_;
  std::string last_;
  bool due_ = true, started_ = false;
};

// Fed while every stage makes progress, also while a start or a reload takes its time.
class Watchdog {
 public:
  explicit Watchdog(const ServiceManager& manager) : manager_(manager) {}
  void feed(const Daemon* daemon) {
    const auto stalled = daemon != nullptr ? daemon->stalled() : std::vector<std::string>();
    if (stalled.empty()) {
      manager_.feed_watchdog();
    } else if (!complained_) {
      for (const std::string& name : stalled) log::error("no progress in {}", name);
    }
    complained_ = !stalled.empty();
  }

 private:
  const ServiceManager& manager_;
  bool complained_ = false;
};

// Until SIGTERM or SIGINT, or until the daemon did not start.
void supervise(ControlThread& control, const ServiceManager& manager, const Signals& signals) {
  Announcer announcer(manager);
  Watchdog watchdog(manager);
  while (!control.failure()) {
    const int number = signals.wait(control.busy() ? 20ms : 500ms);
    if (number == SIGTERM || number == SIGINT) return;
    if (number == SIGHUP) {
      announcer.reloading();
      control.request_reload();
    }
    const auto daemon = control.daemon();
    watchdog.feed(daemon.get());
    if (daemon) daemon->tell_waits();
    announcer.tell(control);
    (void)log::flush(0ms);  // who reads the log may have caught up
    if (daemon) daemon->count_lost_messages();
  }
}

// What cannot be interrupted (a large mesh, a slow disk) is left where it is: nothing is lost by it
// but the last second of a recording, and that is an error.
[[noreturn]] void leave(const ControlThread& control) {
  const bool stopped = control.stopped();
  const auto daemon = control.daemon();
  const StopLeft left = control.left();
  const bool cut = left.recording || (!stopped && daemon && daemon->recording());
  for (const std::string& what : left.what) {
    log::warning("stopped without {}, which still waits for its device or disk", what);
  }
  if (left.what.empty() || cut) {
    log::warning("stopped while {}",
                 cut ? "the recording was still being written; its last second may be missing"
                 : !stopped ? "streams were still being closed"
                            : "the configuration was still being loaded");
  }
  (void)log::flush(kLogPatience);
  _exit(cut ? 1 : 0);
}

int serve(const std::filesystem::path& config) {
  log::never_wait();
  log::keep_history(kEventsKept);
  const auto signals = Signals::create();
  if (!signals) return fail(signals.error());
  const ServiceManager manager;
  ControlThread control(config);
  supervise(control, manager, *signals);
  const auto failure = control.failure();
  if (!failure) manager.stopping();
  if (!control.stop(kPatience)) leave(control);
  if (failure) return fail(*failure);
  if (const Status stopped = control.result(); !stopped) return fail(stopped.error());
  log::info("stopped");
  return 0;
}

// Whatever is wrong with what the file names is the file's mistake here.
int check_only(const std::filesystem::path& config) {
  const Status good = [&]() -> Status {
    SL_ASSIGN(const Installation installation, read_installation(config));
    return check_files(installation);
  }();
  if (good) return 0;
  std::fprintf(stderr, "%s\n", good.error().message().c_str());
  return 2;
}

std::string version_text(bool json) {
  if (!json) return std::string("sightlined ") + kVersion;
  const BuildInfo& build = kBuildInfo;
  return nlohmann::ordered_json{{"program", "sightlined"},
                                {"version", kVersion},
                                {"api", 1},
                                {"build",
                                 {{"type", build.type},
                                  {"compiler", build.compiler},
                                  {"processor", build.processor},
                                  {"sanitizers", build.sanitizers}}},
                                {"options",
                                 {{"aravis", build.aravis},
                                  {"libcamera", build.libcamera},
                                  {"egl", build.egl},
                                  {"webrtc", build.webrtc},
                                  {"mqtt", build.mqtt},
                                  {"page", build.page}}}}
      .dump(2);
}

int run(int argc, char** argv) {
  CLI::App app{"Sightline daemon: live annotated streams of an installation's cameras"};
  std::filesystem::path config;
  bool check = false, json = false;
  // Before --version, which is answered while options are taken in this order.
  app.add_flag("--json", json, "with --version: version, build and optional parts as JSON");
  app.set_version_flag("--version", [&] { return version_text(json); });
  app.add_option("--config", config, "installation file")->required();
  app.add_flag("--check", check, "validate the file and exit with 0 or 2");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return check ? check_only(config) : serve(config);
}

// glibc gives each thread a heap of its own, eight for each core, and what one frees the others
// cannot have: after some hundred reloads a third more than is in use (docs/operation.md, "Soak").
// What is done for each frame allocates next to nothing, so that two are shared without waiting.
void keep_memory_together() {
#ifdef __GLIBC__
  constexpr int kHeaps = 2;
  (void)mallopt(M_ARENA_MAX, kHeaps);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  keep_memory_together();
  int status = 1;
  try {
    status = run(argc, argv);
  } catch (const std::exception& error) {
    log::error("unexpected: {}", error.what());
  }
  (void)log::flush(kLogPatience);
  return status;
}
