// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "sightline/record/recording_sink.hpp"

namespace sightline {

/// A name for a recording that begins now, free in `directory`: "20260504T120000Z", for the other
/// kinds than source with "-viewing" or "-poses" behind, and a number where that is taken.
std::filesystem::path new_recording_folder(const std::filesystem::path& directory,
                                           RecordingKind kind);

/// The kind of a folder with such a name; nullopt: somebody else's.
std::optional<RecordingKind> recording_kind_of(std::string_view name);

/// An error where the directory cannot be had, or has too little room to begin a recording in. May
/// block on the disk.
Status check_recording_space(const std::filesystem::path& directory);

/// Why nothing can be written there.
Error recording_folder_error(const std::filesystem::path& folder, const std::error_code& fault);

}  // namespace sightline
