// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

/// Copies `file` and what it names (mesh, material and texture files beside or below it) into
/// `folder`, so that the copy works by itself. Names in an object file that lead out of its folder
/// are copied beside it and renamed in the copy.
Status copy_with_parts(const std::filesystem::path& file, const std::filesystem::path& folder);

/// Copies object files into `recording`/objects and returns their paths relative to `recording`.
/// Files of the same name get a folder each.
Result<std::vector<std::string>> copy_objects(const std::vector<std::filesystem::path>& objects,
                                              const std::filesystem::path& recording);

}  // namespace sightline
