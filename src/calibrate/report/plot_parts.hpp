// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "sightline/calibrate/assess.hpp"

namespace sightline::calibrate {

// What plots of the reports are made of.
inline constexpr double kWidth = 320;  ///< of a plot [px of the page]
inline constexpr const char* kInk = "#1f5f8b";
inline constexpr const char* kBad = "#c0392b";

/// The beginning of an <svg> element with room for a title above and a note below.
std::string open_svg(double width, double height, const std::string& title);
std::string frame(double width, double height);
std::string note(double x, double y, const std::string& text);

/// The beginning of a report's page, <body> included.
std::string report_head(const std::string& title);
/// Of the page's style sheet.
const char* css_class(CalibrationGrade grade);
/// With its unit; "-": there is none.
std::string number(const std::optional<double>& value, int digits, const char* unit);

}  // namespace sightline::calibrate
