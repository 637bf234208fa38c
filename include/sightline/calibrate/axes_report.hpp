// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sightline/calibrate/assess.hpp"
#include "sightline/calibrate/solve_axes.hpp"

namespace sightline {

/// How good the axes of a head are, by what the fit did not see.
struct AxesReport {
  CalibrationGrade grade = CalibrationGrade::kGood;
  std::vector<std::string> remarks;   ///< sentences: the verdict, and what to do
  size_t at_rest = 0, in_motion = 0;  ///< settings that count
  double pan_from_deg = 0, pan_to_deg = 0, tilt_from_deg = 0,
         tilt_to_deg = 0;  ///< as read, at rest
  double distance = 0;     ///< median of the targets' points from the camera [m]
  /// Root mean squares of settings that were left out, predicted by their readings alone: in the
  /// image, as a turn of the camera, and at the target.
  std::optional<double> held_out_px, held_out_deg, held_out_mm;
  /// One sigma of the camera's place by the fit, over the settings: median and largest.
  double direction_deg = 0, direction_worst_deg = 0, place_mm = 0, place_worst_mm = 0;
  double motion_deg = 0;  ///< RMS of seen less read in motion, latency taken into account
};
AxesReport assess_axes(const AxesSolution& solution);

/// The report as JSON, and as one HTML file that needs nothing beside it (plots are SVG).
std::string axes_report_json(const AxesSolution& solution, const AxesReport& report,
                             const std::string& epoch);
std::string axes_report_html(const AxesSolution& solution, const AxesReport& report,
                             const std::string& epoch);

}  // namespace sightline
