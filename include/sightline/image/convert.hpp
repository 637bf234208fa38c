// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "sightline/base/result.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

/// Copies (same size).
void copy_i420(const I420View& from, const MutableI420View& to);

/// Converts one packed or planar raw picture into I420 (libyuv). `bytes` holds the picture with
/// rows `stride` bytes apart (0: tightly packed). Refuses buffers that are too small.
Status raw_to_i420(PixelFormat format, std::span<const uint8_t> bytes, ptrdiff_t stride,
                   const MutableI420View& to);

/// I420 to packed 24-bit RGB, for pictures on disk; rows of `rgb` are width * 3 bytes.
void i420_to_rgb(const I420View& from, uint8_t* rgb);

/// Half-size grey picture by 2x2 averaging; `to` is width/2 by height/2.
void halve_plane(const PlaneView& from, const MutablePlaneView& to);

}  // namespace sightline
