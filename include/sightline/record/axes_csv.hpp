// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/axis_history.hpp"

namespace sightline {

/// First line of axes.csv: what the heads of cameras that turn said of their angles. Angles in
/// degrees as the device counts, zoom as its encoder counts, `moving` 1 while it says that it
/// turns; times on the clock of frames.csv.
inline constexpr std::string_view kAxesHeader = "camera,t_ns,pan_deg,tilt_deg,zoom,moving";

/// One row, without line end. Angles to 1e-6 degrees.
std::string format_axes_row(std::string_view camera, const AxisReading& reading);

/// The readings, one vector per name in `cameras`, in order of time. Refused, naming the line: a
/// wrong header, missing or non-numeric columns, angles beyond a hundred turns, unknown cameras,
/// and times of a camera that do not grow. A last line that was cut off is left out with a warning.
Result<std::vector<std::vector<AxisReading>>> parse_axes_csv(std::string_view text,
                                                             const std::string& where,
                                                             std::span<const std::string> cameras,
                                                             std::vector<std::string>* warnings);

/// The same from a file.
Result<std::vector<std::vector<AxisReading>>> read_axes_csv(const std::filesystem::path& path,
                                                            std::span<const std::string> cameras,
                                                            std::vector<std::string>* warnings);

}  // namespace sightline
