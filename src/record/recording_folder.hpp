// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "sightline/base/result.hpp"

namespace sightline::record {

/// Makes the folder; its parent must exist. One that is there has to be empty.
Status make_recording_folder(const std::filesystem::path& folder);

}  // namespace sightline::record
