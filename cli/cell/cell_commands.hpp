// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "commands.hpp"

namespace sightline::cli {

/// What several hosts with one rig need: `sightline cell` with its sub-commands, `sightline merge`.
void add_cell(CLI::App& app, Command& chosen);
void add_merge(CLI::App& app, Command& chosen);
void add_cell_init(CLI::App& app, Command& chosen);
void add_cell_status(CLI::App& app, Command& chosen);

}  // namespace sightline::cli
