// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibrate/solve/bundle.hpp"
#include "calibrate/solve/target_pose.hpp"
#include "sightline/calibrate/solve.hpp"

namespace sightline::calibrate {

/// "camera right", for the place of an error.
std::string camera_place(const CalibrationViews& views, size_t camera);

/// Before anything is solved: numbers of views, links, sizes, the same-after-half-turn chessboard.
Status check_inputs(const CalibrationViews& views, const SolveOptions& options);

/// A camera that was solved for alone: the target fits, and the views determine its focal length.
/// `poses` and `views` in the same order.
Status check_camera(const CalibrationViews& all, size_t camera, const Bundle& alone, double rms_px);

/// Known lenses: each fits its own camera best.
Status check_exchanged(const CalibrationViews& views, const SolveOptions& options);

}  // namespace sightline::calibrate
