// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace sightline::record {

/// One reference to another file. Formats that leave open where a name with spaces begins have
/// several readings of it; the first that is a file counts.
using PartReference = std::vector<std::string>;

/// What a file names, told by its extension and its own grammar: of an object file `mesh` and
/// `features`, of OBJ its material libraries, of MTL its textures, of glTF and GLB buffers and
/// images. Nothing of other files, and nothing of what is damaged. Comments and other text name
/// nothing.
std::vector<PartReference> parts_named_by(const std::filesystem::path& file,
                                          std::string_view content);

}  // namespace sightline::record
