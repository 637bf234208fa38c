// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <toml++/toml.h>

#include <string>

#include "sightline/geometry/camera_model.hpp"

namespace sightline::calibrate {

/// "FILE:LINE:COLUMN" of a place in the file.
std::string place(const std::string& file, const toml::source_region& region);

/// One [[camera]] table.
Result<CalibratedCamera> read_camera(const toml::table& table, const std::string& file);

}  // namespace sightline::calibrate
