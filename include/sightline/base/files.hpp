// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"

namespace sightline {

/// The whole of a regular file. Refuses directories, devices and files over `limit_bytes`.
Result<std::string> read_file(const std::filesystem::path& path,
                              size_t limit_bytes = size_t{256} << 20);

/// Replaces `path` so that a crash leaves the old file or the new one, never a part: written beside
/// it, synced, renamed. Permissions: by the umask, none that the replaced file did not have.
Status write_file_atomically(const std::filesystem::path& path, std::string_view content);

/// Stable 64-bit content hash (FNV-1a), for cache keys and calibration epochs; not for security.
uint64_t content_hash(std::string_view content);

}  // namespace sightline
