// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "config/toml_reader.hpp"
#include "sightline/config/installation.hpp"

namespace sightline::config {

/// [rtsp], [http] and [access]: who is served where, and who may come.
void read_servers(TomlTable& root, const std::filesystem::path& path,
                  const InstallationFiles& files, Installation& installation);

}  // namespace sightline::config
