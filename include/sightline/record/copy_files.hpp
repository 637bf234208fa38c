// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

/// Copies a file into `folder`, and with an object file or a mesh what it names, so that the copy
/// works by itself. Only what lies in the folder of the file that names it is copied; a sentence
/// about each of the rest goes into `left_out`.
Status copy_file_and_parts(const std::filesystem::path& file, const std::filesystem::path& folder,
                           std::vector<std::string>& left_out);

}  // namespace sightline
