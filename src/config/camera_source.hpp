// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "config/toml_reader.hpp"
#include "sightline/config/installation.hpp"

namespace sightline::config {

/// Reads `source` of a table [[camera]] and the keys that go with this kind of source; those of
/// another kind are reported. `camera` has its name, rate and calibration already.
void read_camera_source(TomlTable& table, const std::filesystem::path& file,
                        const InstallationFiles& files, CameraConfig& camera);

}  // namespace sightline::config
