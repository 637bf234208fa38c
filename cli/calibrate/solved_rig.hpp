// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "sightline/calibrate/assess.hpp"
#include "sightline/calibrate/solve.hpp"

namespace sightline::cli {

/// On stdout, as a table for a person or as JSON.
void print_solved(const CalibrationViews& views, const SolvedRig& solved, bool json,
                  const std::filesystem::path& folder);

/// The camera of that name, or the first where the name is empty.
Result<size_t> reference_camera(const CalibrationViews& views, const std::string& name);

}  // namespace sightline::cli
