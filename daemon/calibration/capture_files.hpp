// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calibration/capture_session.hpp"
#include "sightline/calibrate/assess.hpp"
#include "sightline/calibrate/solve.hpp"

namespace sightline {

/// The hash that names a calibration.
std::string epoch_of(const CalibrationViews& views, const RigSolution& solution);

/// Writes corners.csv, report.json, report.html, and last calibration.toml: it is in force once it
/// is there, and what explains it is there by then.
Status write_solved(const std::filesystem::path& folder, const CalibrationViews& views,
                    const SolvedRig& solved);

/// Writes what was taken so far, so that nothing of it can be lost: corners.csv (once there is a
/// set), coverage_CAMERA.svg of each of `cameras`, capture.html.
Status keep_capture(const CaptureSession& session, const std::vector<std::string>& cameras,
                    const std::filesystem::path& folder, bool over);

}  // namespace sightline
