// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/calibrate/solve_axes.hpp"

namespace sightline::calibrate {

/// Each returns one <svg> element.
/// Settings at rest by pan and tilt, as large as what was held out is off, with what the readings
/// are wrong by as lines; says by how much both are magnified.
std::string setting_error_plot(const AxesSolution& solution);
/// Where the head was: settings at rest (left out ones red), images in motion.
std::string setting_coverage_plot(const AxesSolution& solution);
/// What the picture says less the readings, by the latency that is taken.
std::string latency_plot(const LatencyCurve& curve, double latency_s);

}  // namespace sightline::calibrate
