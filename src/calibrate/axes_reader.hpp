// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <toml++/toml.h>

#include <string>

#include "sightline/geometry/camera_model.hpp"

namespace sightline::calibrate {

/// One [camera.axes] table; docs/turning.md. `lens` says how many coefficients a lens of its zoom
/// table takes.
Result<CameraAxes> read_camera_axes(const toml::table& table, size_t coefficients,
                                    const std::string& file);

/// Text that it reads back, beginning with "[camera.axes]".
std::string format_camera_axes(const CameraAxes& axes, size_t coefficients);

/// Shortest text that reads back to the same number, and reads as a number with fraction.
std::string number_text(double value);
/// "[1.0, 2.0]"
std::string list_text(const double* values, size_t count);
/// Rows of a matrix, each on a line of its own.
std::string pose_text(const char* key, const Rigid3& pose);

}  // namespace sightline::calibrate
