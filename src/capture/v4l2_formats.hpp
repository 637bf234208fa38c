// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "bayer_decoder.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

/// How frames of a V4L2 format become pictures.
enum class V4l2Kind : uint8_t { kRaw, kBayer, kMjpeg, kH264 };

struct V4l2Format {
  uint32_t fourcc;
  std::string_view name;  ///< V4L2's own, without V4L2_PIX_FMT_
  V4l2Kind kind;
  PixelFormat pixels;  ///< kRaw, kMjpeg, kH264
  MosaicPattern pattern = MosaicPattern::kRggb;
  BayerPacking packing = BayerPacking::k8;
};

/// All formats known here, most wanted first for `format = "auto"`.
std::span<const V4l2Format> v4l2_formats();
const V4l2Format* find_v4l2_format(uint32_t fourcc);
/// By its name, by a usual other name (I420, MJPG, RGB3) or by its four characters.
const V4l2Format* find_v4l2_format(std::string_view name);
/// Four characters, for formats without a name here.
std::string fourcc_text(uint32_t fourcc);
/// Name where known, else the four characters.
std::string v4l2_format_name(uint32_t fourcc);

}  // namespace sightline
