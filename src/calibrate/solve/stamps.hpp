// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/calibrate/solve.hpp"

namespace sightline::calibrate {

/// Refuses a solution without time offsets of a target in motion, if a camera's stamps are off by
/// so much that its corners are not where the solution takes them to be. Costs nothing where the
/// target stood still.
Status check_stamps(const CalibrationViews& views, const SolveOptions& options,
                    const RigSolution& solution);

}  // namespace sightline::calibrate
