// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "record/media/av.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::record {

/// The frame's raw image, tightly packed, in `format`. Points into the payload where that is
/// tight already, else into `scratch`. A frame without payload gives its I420 image.
Result<std::span<const uint8_t>> tight_raw_image(const Frame& frame, PixelFormat format,
                                                 std::vector<uint8_t>& scratch);

/// The libavcodec format that holds `format` without loss for FFV1; nullopt: none.
std::optional<AVPixelFormat> planar_format(PixelFormat format);

/// Fills an encoder's frame of planar_format(format) from a tight raw image.
void fill_planar(PixelFormat format, std::span<const uint8_t> tight, AVFrame& frame);

}  // namespace sightline::record
