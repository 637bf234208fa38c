// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

/// "I420", "YUYV", ... for messages and files.
std::string_view to_string(PixelFormat format);

/// Sets every pixel to `value`.
void fill_plane(const MutablePlaneView& plane, uint8_t value);

/// Copies (same size).
void copy_i420(const I420View& from, const MutableI420View& to);

/// Bytes that a raw image takes, rows `stride` bytes apart (0: tightly packed); the last row need
/// not be padded. I420: chroma rows are (stride + 1) / 2 apart. Refuses sizes outside 1..32768, a
/// stride shorter than a row, and compressed formats.
Result<size_t> raw_image_bytes(PixelFormat format, int width, int height, ptrdiff_t stride);

/// Converts one packed or planar raw image into I420 (libyuv), BT.601 limited range. `bytes`
/// holds the image with rows `stride` bytes apart (0: tightly packed); kRgb24 is R, G, B in
/// memory; kY10..kY16 are little-endian, value in the low bits. Gray is full range at the sensor
/// and compressed into 16..235. Refuses buffers that are too small and compressed formats.
Status raw_to_i420(PixelFormat format, std::span<const uint8_t> bytes, ptrdiff_t stride,
                   const MutableI420View& to);

/// I420 to packed 24-bit RGB, for images on disk; rows of `rgb` are width * 3 bytes.
void i420_to_rgb(const I420View& from, uint8_t* rgb);

/// Half-size gray image by 2x2 averaging; `to` is width/2 by height/2.
void halve_plane(const PlaneView& from, const MutablePlaneView& to);
/// The same of squares of `factor` x `factor` pixels (not rounded but cut, where that is no power
/// of two): `to` is floor(width / factor) wide, its height likewise.
void shrink_plane(const PlaneView& from, int factor, const MutablePlaneView& to);

}  // namespace sightline
