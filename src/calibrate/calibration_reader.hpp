// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <toml++/toml.h>

#include <string>

#include "calibrate/toml_numbers.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline::calibrate {

constexpr double kLargestReadout = 0.2;  // [s]; sensors take less than a frame

/// One [[camera]] table.
Result<CalibratedCamera> read_camera(const toml::table& table, const std::string& file);

}  // namespace sightline::calibrate
