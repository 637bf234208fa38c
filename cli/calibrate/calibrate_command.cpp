// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>

#include "calibrate/calibrate_commands.hpp"

namespace sightline::cli {

void add_calibrate(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand(
      "calibrate", "lenses and places of a rig's cameras, with a report of how good they are");
  command->require_subcommand(1);
  add_calibrate_target(*command, chosen);
  add_calibrate_capture(*command, chosen);
  add_calibrate_solve(*command, chosen);
  add_calibrate_check(*command, chosen);
  add_calibrate_axes(*command, chosen);
  add_calibrate_world(*command, chosen);
  add_calibrate_accept(*command, chosen);
  add_calibrate_import(*command, chosen);
  add_calibrate_export(*command, chosen);
}

}  // namespace sightline::cli
