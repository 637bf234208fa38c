// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/calibration_target.hpp"

namespace sightline {

/// What is dark on a target's print. A ChArUco board of layout kAny is printed dark first. Refused:
/// a dictionary or family that is not known or has too few markers, inverted boards.
Result<std::vector<PrintedRect>> target_print(const CalibrationTarget& target);

}  // namespace sightline
