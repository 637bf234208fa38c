// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/image/image.hpp"

namespace sightline {

/// Reads one still image (PNG, JPEG, BMP, TIFF, PNM, WebP; told by its first bytes) as I420,
/// BT.601 limited range. Decodes with libavcodec in the calling thread. Refused by name: other
/// formats, damaged files, sides outside 1..32768.
Result<std::shared_ptr<const Image>> read_image(const std::filesystem::path& path);

/// The same from memory; `where` names the file in errors.
Result<std::shared_ptr<const Image>> parse_image(std::string_view bytes, const std::string& where);

/// Depth of the static scene in one camera, as people keep it in a file.
struct DepthImage {
  int width = 0, height = 0;
  std::vector<float> depth;  ///< row-major, along the camera's axis [m]; 0: no surface
};

/// Reads 16-bit gray PNG or TIFF, or OpenEXR (channel Z, depth, V, Y, G or R, the first of these
/// that there is, or the only one), `meters_per_unit` times the number in the file; 0, negative and
/// not finite mean no surface. Refused by name: 8-bit images, other formats, damaged files, deep
/// OpenEXR, more than 64 Mi pixels of it, an image without any surface.
Result<DepthImage> read_depth_image(const std::filesystem::path& path, double meters_per_unit);

/// The same from memory; `where` names the file in errors.
Result<DepthImage> parse_depth_image(std::string_view bytes, const std::string& where,
                                     double meters_per_unit);

}  // namespace sightline
