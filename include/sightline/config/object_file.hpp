// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/object.hpp"

namespace sightline {

/// Reads an object file (docs/configuration.md, "Object file"). All mistakes are reported at once:
/// `where` is that of the first ("file:line:column"), `text` has one line for each. Refused:
/// unknown keys, families and dictionaries; sizes that are not positive or look like a wrong unit;
/// a board whose marker is not smaller than its square; a matrix that is no rigid transform; a mesh
/// that does not exist; two fiducials of the same family and id.
Result<ObjectDescription> read_object_file(const std::filesystem::path& path);

/// The same from memory; `path` stands in errors and is where the mesh's path starts.
/// `is_file(path)` answers for the file system.
Result<ObjectDescription> parse_object_file(
    std::string_view text, const std::filesystem::path& path,
    const std::function<bool(const std::filesystem::path&)>& is_file);

/// Modalities by name ("fiducial", "region", "edge", "texture"), as in the key `modalities` of an
/// object file and in `sightline replay --modalities`. Those that are not named are off.
Result<Modalities> parse_modalities(const std::vector<std::string>& names,
                                    const std::string& where);

}  // namespace sightline
