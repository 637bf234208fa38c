// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace sightline::cli {

/// What the command line asks for. It prints to stdout what was asked for, to stderr what went
/// wrong, and returns the exit status (CONVENTIONS.md).
using Command = std::function<int()>;

/// Each adds one command of `sightline` to the application; where the command line names it,
/// parsing sets `chosen`, which must outlive that.
void add_calibrate(CLI::App& app, Command& chosen);
void add_cameras(CLI::App& app, Command& chosen);
void add_check(CLI::App& app, Command& chosen);
void add_detect(CLI::App& app, Command& chosen);
void add_doctor(CLI::App& app, Command& chosen);
void add_evaluate(CLI::App& app, Command& chosen);
void add_init(CLI::App& app, Command& chosen);
void add_model(CLI::App& app, Command& chosen);
void add_record(CLI::App& app, Command& chosen);
void add_replay(CLI::App& app, Command& chosen);
void add_superimpose(CLI::App& app, Command& chosen);
void add_train(CLI::App& app, Command& chosen);
void add_view(CLI::App& app, Command& chosen);

}  // namespace sightline::cli
