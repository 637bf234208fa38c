// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "av.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

/// The frame's raw picture, tightly packed, in `format`. Points into the payload where that is
/// tight already, else into `scratch`. A frame without payload gives its I420 picture.
Result<std::span<const uint8_t>> tight_raw_picture(const Frame& frame, PixelFormat format,
                                                   std::vector<uint8_t>& scratch);

/// The libavcodec format that holds `format` without loss for FFV1; nullopt: none.
std::optional<AVPixelFormat> planar_format(PixelFormat format);

/// Fills an encoder's frame of planar_format(format) from a tight raw picture.
void fill_planar(PixelFormat format, std::span<const uint8_t> tight, AVFrame& frame);

}  // namespace sightline
