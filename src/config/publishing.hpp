// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "config/toml_reader.hpp"
#include "sightline/config/installation.hpp"

namespace sightline::config {

/// [publish].
void read_publish(TomlTable& root, const std::filesystem::path& path,
                  const InstallationFiles& files, Installation& installation);

/// [cell]. Its host is this machine's name unless the file gives one.
/// Where browsers of other hosts find this one's page, unless the file says it: by the first of
/// `names` of [http], the address, or the machine's name. Nowhere if that is loopback.
void name_page(Installation& installation);
void read_cell(TomlTable& root, const std::filesystem::path& path, const InstallationFiles& files,
               Installation& installation);
/// Of a camera: whether it is another host's, and which one's. Notes where that has no meaning.
bool is_remote(TomlTable& camera, const Installation& installation, RemoteCamera& remote);
/// After the cameras: whether their hosts fit the role.
void check_cell(TomlTable& root, Installation& installation);

}  // namespace sightline::config
