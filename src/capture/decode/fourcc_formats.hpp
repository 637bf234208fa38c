// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "capture/decode/bayer_decoder.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::capture {

/// How the bytes of a buffer become an image.
enum class FormatKind : uint8_t { kRaw, kBayer, kMjpeg, kH264 };

/// A format that a camera's buffers may have, as the kernel (V4L2) calls it.
struct FourccFormat {
  uint32_t fourcc;        ///< V4L2_PIX_FMT_...
  std::string_view name;  ///< the same, without V4L2_PIX_FMT_
  FormatKind kind;
  PixelFormat pixels;  ///< kRaw, kMjpeg, kH264
  MosaicPattern pattern = MosaicPattern::kRggb;
  BayerPacking packing = BayerPacking::k8;
};

/// All formats known here, in order of preference for `format = "auto"`.
std::span<const FourccFormat> fourcc_formats();
const FourccFormat* find_fourcc_format(uint32_t fourcc);
/// By its name, by a usual other name (I420, MJPG, YUY2) or by its four characters.
const FourccFormat* find_fourcc_format(std::string_view name);
/// Four characters, for formats without a name here.
std::string fourcc_text(uint32_t fourcc);
/// Name where known, else the four characters.
std::string fourcc_name(uint32_t fourcc);

}  // namespace sightline::capture
