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

/// Reads `axes`, who tells the angles of a camera that turns, and what goes with it. `camera` has
/// its source and calibration already.
void read_axes(TomlTable& table, const std::filesystem::path& file, bool calibrated,
               CameraConfig& camera);

/// Of a camera that is to be calibrated: the size that its source is asked for, `width` and
/// `height` of the table if they are there.
void read_own_size(TomlTable& table, bool calibrated, CameraConfig& camera);

}  // namespace sightline::config
