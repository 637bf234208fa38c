// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "capture/decode/fourcc_formats.hpp"

namespace sightline::capture {

/// The format that libcamera calls `name` ("R8", "SRGGB10_CSI2P"), or that a user calls so; null:
/// one that is not known here. libcamera's formats are V4L2's by other names.
const FourccFormat* find_libcamera_format(std::string_view name);

}  // namespace sightline::capture
