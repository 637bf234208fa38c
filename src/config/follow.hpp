// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "config/toml_reader.hpp"
#include "sightline/config/installation.hpp"

namespace sightline::config {

/// Reads [camera.follow] of a table [[camera]]. `camera` has its role and who tells its angles.
void read_follow(TomlTable& table, CameraConfig& camera);
/// After cameras and objects: whether there is what is to be followed.
void check_followed(TomlTable& root, const Installation& installation);

}  // namespace sightline::config
