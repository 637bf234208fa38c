// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "config/toml_reader.hpp"
#include "sightline/config/installation.hpp"

namespace sightline::config {

/// The key `start` of [[object]]: "last", or world_from_object as 4 rows of 4 numbers.
void read_start(TomlTable& table, ObjectConfig& object);

}  // namespace sightline::config
