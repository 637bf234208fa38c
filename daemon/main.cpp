// SPDX-License-Identifier: Apache-2.0
// `sightlined`: reads the installation, runs it, and answers signals and the service manager.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include "daemon.hpp"
#include "service_manager.hpp"
#include "sightline/base/log.hpp"
#include "signals.hpp"
#include "version.hpp"

namespace {

using namespace sightline;
using namespace std::chrono_literals;

int fail(const Error& error) {
  log::error("{}", error.message());
  return exit_code(error);
}

void reload(Daemon& daemon, const ServiceManager& manager, const std::filesystem::path& config) {
  manager.reloading();
  auto next = read_installation(config);
  Status done = next ? daemon.reload(*std::move(next)) : Status(next.error());
  if (!done) {
    log::error("reload refused, everything goes on as before: {}", done.error().message());
  }
  manager.ready(daemon.status_line());
}

// Feeds the watchdog while every stage makes progress, until SIGTERM or SIGINT.
void supervise(Daemon& daemon, const ServiceManager& manager, const Signals& signals,
               const std::filesystem::path& config) {
  std::string last_status;
  bool complained = false;
  for (;;) {
    const int number = signals.wait(500ms);
    if (number == SIGTERM || number == SIGINT) return;
    if (number == SIGHUP) reload(daemon, manager, config);
    const auto stalled = daemon.stalled();
    if (stalled.empty()) {
      manager.feed_watchdog();
    } else if (!complained) {
      for (const std::string& name : stalled) log::error("thread {} makes no progress", name);
    }
    complained = !stalled.empty();
    const std::string status = daemon.status_line();
    if (status != last_status) manager.status(status);
    last_status = status;
  }
}

int serve(const std::filesystem::path& config) {
  const auto signals = Signals::create();
  if (!signals) return fail(signals.error());
  auto installation = read_installation(config);
  if (!installation) return fail(installation.error());
  const ServiceManager manager;
  auto daemon = Daemon::start(*std::move(installation), {});
  if (!daemon) return fail(daemon.error());
  for (const std::string& address : (*daemon)->addresses()) log::info("{}", address);
  manager.ready((*daemon)->status_line());
  supervise(**daemon, manager, *signals, config);
  manager.stopping();
  const Status stopped = (*daemon)->stop();
  if (!stopped) return fail(stopped.error());
  log::info("stopped");
  return 0;
}

int run(int argc, char** argv) {
  CLI::App app{"Sightline daemon: live annotated streams of an installation's cameras"};
  app.set_version_flag("--version", std::string("sightlined ") + kVersion);
  std::filesystem::path config;
  bool check = false;
  app.add_option("--config", config, "installation file")->required();
  app.add_flag("--check", check, "validate the file and exit with 0 or 2");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (!check) return serve(config);
  const auto installation = read_installation(config);
  if (installation) return 0;
  std::fprintf(stderr, "%s\n", installation.error().message().c_str());
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "sightlined: unexpected: %s\n", error.what());
    return 1;
  }
}
