// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "config/section_reader.hpp"

namespace sightline::config {

/// [[zone]] of an installation whose objects and [record] have been read.
void read_zones(TomlTable& root, const std::filesystem::path& path, const InstallationFiles& files,
                Installation& installation);

}  // namespace sightline::config
