// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/image/picture.hpp"

namespace sightline {

/// Reads one still image (PNG, JPEG, BMP, TIFF, PNM, WebP; told by its first bytes) as I420,
/// BT.601 limited range. Decodes with libavcodec in the calling thread. Refused by name: other
/// formats, damaged files, sides outside 1..32768.
Result<std::shared_ptr<const Picture>> read_picture(const std::filesystem::path& path);

/// The same from memory; `where` names the file in errors.
Result<std::shared_ptr<const Picture>> parse_picture(std::string_view bytes,
                                                     const std::string& where);

}  // namespace sightline
