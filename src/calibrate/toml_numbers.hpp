// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <toml++/toml.h>

#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::calibrate {

/// "FILE:LINE:COLUMN" of a place in the file.
std::string place(const std::string& file, const toml::source_region& region);

/// "text", "a list", ...: what stands there instead.
const char* kind_of(const toml::node& node);

/// A finite number. `key` and `file` go into errors.
Result<double> number_of(const toml::node& node, const char* key, const std::string& file);
/// A list of finite numbers.
Result<std::vector<double>> numbers_of(const toml::node& node, const char* key,
                                       const std::string& file);
/// A pose as four rows of four, or sixteen numbers, row by row.
Result<Rigid3> pose_of(const toml::node& node, const char* key, const std::string& file);

}  // namespace sightline::calibrate
