// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::cli {

/// Numbers that commas separate; none if any part is not one.
std::optional<std::vector<double>> parse_numbers(std::string_view text);

/// A pose of 7 numbers as in pose logs (tx ty tz qw qx qy qz), or of 6 as OpenCV gives them (rvec,
/// tvec). `option` stands in errors.
Result<Rigid3> parse_pose(const std::vector<double>& numbers, const std::string& option);

}  // namespace sightline::cli
