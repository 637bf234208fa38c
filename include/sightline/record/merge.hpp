// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/record/recording.hpp"

namespace sightline {

/// One of several recordings of a rig, made at the same time on different hosts.
struct MergePart {
  Recording recording;
  RecordingManifest manifest;
  int64_t utc_minus_monotonic_ns = 0;  ///< of its host's clocks, when it began
};

/// Opens it. Refused: one that does not say how its clock relates to UTC (start_utc and
/// start_monotonic_ns of recording.toml).
Result<MergePart> open_merge_part(const std::filesystem::path& folder);

/// Nanoseconds since 1970 of an RFC 3339 time with its zone.
Result<int64_t> parse_rfc3339(std::string_view text, const std::string& where);

/// Makes `folder` of the parts: their videos as they are, all rows of frames.csv, axes.csv and
/// poses.csv by time on the first part's clock, objects and scene of the first part. Refused: a
/// camera that two parts have, a folder that holds anything. `progress` hears of each file.
Status write_merged_recording(const std::vector<MergePart>& parts,
                              const std::string& calibration_toml,
                              const std::filesystem::path& folder,
                              const std::function<void(const std::string&)>& progress);

}  // namespace sightline
