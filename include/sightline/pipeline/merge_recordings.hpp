// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

struct MergedRecordings {
  size_t cameras = 0, frames = 0;
  std::vector<std::string> warnings;
};

/// Makes one recording of those that several hosts of a cell have made at the same time: `out`.
/// Times are set beside each other by UTC. Refused by name: calibrations of a camera, objects and
/// scenes that do not agree, a camera that two of them have, a recording that does not know UTC.
Result<MergedRecordings> merge_recordings(
    const std::vector<std::filesystem::path>& folders, const std::filesystem::path& out,
    const std::function<void(const std::string& file)>& progress);

}  // namespace sightline
