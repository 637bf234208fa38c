// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "calibrate/solve/bundle.hpp"
#include "sightline/calibrate/assess.hpp"

namespace sightline::calibrate {

/// See ProjectionSigma. The camera's pose is fitted away where corners were seen: an error of the
/// lens that looks like a small turn of the camera costs nothing there. Empty if the lens was
/// given.
std::optional<ProjectionSigma> projection_sigma(const CalibrationViews& views, const Bundle& rig,
                                                const RigSolution& solution, size_t camera,
                                                double distance);

}  // namespace sightline::calibrate
