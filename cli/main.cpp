// SPDX-License-Identifier: Apache-2.0
// `sightline`: everything about a rig that is not the daemon itself.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "cell/cell_commands.hpp"
#include "commands.hpp"
#include "sightline/base/log.hpp"
#include "version.hpp"

namespace {

using namespace sightline;

int run(int argc, char** argv) {
  CLI::App app{"Sightline: live annotated video streams of a known object, for fixed camera rigs"};
  app.set_version_flag("--version", std::string("sightline ") + kVersion);
  app.require_subcommand(1);
  bool verbose = false;
  app.add_flag("-v,--verbose", verbose, "say more on stderr");

  cli::Command chosen;
  for (const auto add :
       {cli::add_check, cli::add_evaluate, cli::add_replay, cli::add_record, cli::add_cameras,
        cli::add_model, cli::add_superimpose, cli::add_view, cli::add_train, cli::add_detect,
        cli::add_calibrate, cli::add_doctor, cli::add_init, cli::add_cell, cli::add_merge}) {
    add(app, chosen);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;  // CLI11 has many numbers; wrong usage is 2
  }
  if (verbose) log::set_level(log::Level::kDebug);
  return chosen();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "sightline: unexpected: %s\n", error.what());
    return 1;
  }
}
