// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/solve.hpp"
#include "sightline/calibrate/views.hpp"

namespace CLI {
class App;
}

namespace sightline::cli {

/// Where views come from, as `calibrate solve` and `calibrate check` are told.
struct ViewArguments {
  std::filesystem::path recording;  ///< a recording, or corners.csv
  std::vector<std::string> images;  ///< NAME=FOLDER or NAME=PATTERN, instead
  /// target.toml of each; empty: the recording's object with a board
  std::vector<std::filesystem::path> targets;
  std::vector<std::string> cameras;
  int window = 0;
  size_t every = 1;
  bool by_any = false;  ///< see TargetViewsOptions
};
void add_view_arguments(CLI::App& command, ViewArguments& to);

/// Finds the target, with a progress bar.
Result<CalibrationViews> load_views(const ViewArguments& arguments);

/// The first with the others beside it. Refused: two that share markers.
Result<CalibrationTarget> read_targets(const std::vector<std::filesystem::path>& files);

/// "brown_conrady", "rational" or "fisheye" for all cameras, or "NAME=MODEL" for one.
Result<std::vector<CameraPrior>> parse_priors(const CalibrationViews& views,
                                              const std::vector<std::string>& models,
                                              const std::filesystem::path& known);

}  // namespace sightline::cli
