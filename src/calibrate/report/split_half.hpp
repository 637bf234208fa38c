// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "sightline/calibrate/assess.hpp"

namespace sightline::calibrate {

/// Every other set alone (`odd`: the second, fourth..), of those that were used.
CalibrationViews half_of(const CalibrationViews& views, const RigSolution& solution, bool odd,
                         std::vector<char>& sets);

/// How two solutions of the same cameras differ, at the target's corners of `whole`. Each is first
/// laid over `whole` by the poses of the target that they share.
std::vector<SplitHalf> compare(const CalibrationViews& views, const RigSolution& whole,
                               const RigSolution& a, const RigSolution& b);

}  // namespace sightline::calibrate
