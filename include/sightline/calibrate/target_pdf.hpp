// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/calibration_target.hpp"

namespace sightline {

struct Paper {
  std::string name;              ///< "A4"
  double width = 0, height = 0;  ///< [m], landscape or portrait as given
};

/// "A4", "A3", "letter" (any case); landscape if `landscape`.
Result<Paper> find_paper(const std::string& name, bool landscape);

/// One page with the target in its middle, a ruler of 100 mm to check the scale of the print, and a
/// line that says what it is. PDF 1.4, vectors only. Refused: a target that does not fit.
Result<std::string> target_pdf(const CalibrationTarget& target,
                               const std::vector<PrintedRect>& dark, const Paper& paper);

/// The largest size of squares (tags) in whole millimeters that fits the paper [m]; keeps the
/// proportions of marker and gap. 0 if nothing does.
double largest_square(const CalibrationTarget& target, const Paper& paper);

}  // namespace sightline
