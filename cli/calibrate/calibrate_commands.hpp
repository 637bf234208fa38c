// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "commands.hpp"

namespace sightline::cli {

/// The sub-commands of `sightline calibrate`, each added to it.
void add_calibrate_accept(CLI::App& parent, Command& chosen);
void add_calibrate_axes(CLI::App& parent, Command& chosen);
void add_calibrate_capture(CLI::App& parent, Command& chosen);
void add_calibrate_check(CLI::App& parent, Command& chosen);
void add_calibrate_export(CLI::App& parent, Command& chosen);
void add_calibrate_import(CLI::App& parent, Command& chosen);
void add_calibrate_solve(CLI::App& parent, Command& chosen);
void add_calibrate_target(CLI::App& parent, Command& chosen);
void add_calibrate_world(CLI::App& parent, Command& chosen);

}  // namespace sightline::cli
