// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibrate/solve/bundle.hpp"
#include "sightline/calibrate/solve.hpp"

namespace sightline::calibrate {

/// A solution as the problem it solves, everything held.
Bundle rig_bundle(const CalibrationViews& views, const RigSolution& solution);

}  // namespace sightline::calibrate
