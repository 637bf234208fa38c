// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/calibrate/solve.hpp"

namespace sightline::calibrate {

/// Refuses a solution without time offsets of a target in motion, if a camera's stamps are off by
/// so much that its corners are not where the solution takes them to be. Costs nothing where the
/// target stood still.
Status check_stamps(const CalibrationViews& views, const SolveOptions& options,
                    const RigSolution& solution);

/// What there is to say, by camera, of a solution without SolveOptions::readouts whose target was
/// in motion: that rows are exposed one after the other, and by how much. Empty: nothing.
std::vector<std::string> readout_remarks(const CalibrationViews& views, const SolveOptions& options,
                                         const RigSolution& solution);

}  // namespace sightline::calibrate
