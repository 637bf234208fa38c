// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline::record {

/// Copies `file` and what it names (see parts_named_by(): mesh, features, materials, textures) into
/// `folder`, so that the copy works by itself. A file may come from a stranger: only what lies in
/// the folder of the file that names it, after following links, is copied. Everything else is left
/// out, and a sentence about each goes into `left_out`. What is not there is passed over.
Status copy_with_parts(const std::filesystem::path& file, const std::filesystem::path& folder,
                       std::vector<std::string>& left_out);

/// Copies object files into `recording`/objects and returns their paths relative to `recording`.
/// Files of the same name or of different folders get a folder each.
Result<std::vector<std::string>> copy_objects(const std::vector<std::filesystem::path>& objects,
                                              const std::filesystem::path& recording,
                                              std::vector<std::string>& left_out);

}  // namespace sightline::record
