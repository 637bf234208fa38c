// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/record/still_image.hpp"

namespace sightline::record {

/// True for what begins as OpenEXR does.
bool is_exr(std::string_view bytes);

/// The depth of an OpenEXR image as the numbers in the file, of the size of its display window; 0
/// where it holds no pixels. The channel is Z, depth, V, Y, G or R, the first of these that there
/// is (in a layer, "Depth.Z", too), or the only one. Scan lines and tiles, all compressions of
/// OpenEXR; of several parts the first. Refused before memory is asked for: deep images, sides over
/// 32768, more than 64 Mi pixels, pieces that unpack to more than 256 MiB.
Result<DepthImage> read_exr_depth(std::string_view bytes, const std::string& where);

}  // namespace sightline::record
