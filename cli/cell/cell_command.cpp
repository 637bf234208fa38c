// SPDX-License-Identifier: Apache-2.0
// `sightline cell`: several hosts with one rig.
#include <CLI/CLI.hpp>

#include "cell/cell_commands.hpp"

namespace sightline::cli {

void add_cell(CLI::App& app, Command& chosen) {
  CLI::App* cell = app.add_subcommand("cell", "several hosts with one rig: set up, look");
  cell->require_subcommand(1);
  add_cell_init(*cell, chosen);
  add_cell_status(*cell, chosen);
}

}  // namespace sightline::cli
