// SPDX-License-Identifier: Apache-2.0
#include "v4l2_formats.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cctype>

namespace sightline {
namespace {

constexpr V4l2Format raw(uint32_t fourcc, std::string_view name, PixelFormat pixels) {
  return {fourcc, name, V4l2Kind::kRaw, pixels};
}
constexpr V4l2Format bayer(uint32_t fourcc, std::string_view name, MosaicPattern pattern,
                           BayerPacking packing) {
  return {fourcc, name, V4l2Kind::kBayer, PixelFormat::kI420, pattern, packing};
}

using P = MosaicPattern;
using B = BayerPacking;

constexpr std::array kFormats = {
    raw(V4L2_PIX_FMT_NV12, "NV12", PixelFormat::kNv12),
    raw(V4L2_PIX_FMT_YUV420, "YUV420", PixelFormat::kI420),
    raw(V4L2_PIX_FMT_YUYV, "YUYV", PixelFormat::kYuyv),
    raw(V4L2_PIX_FMT_UYVY, "UYVY", PixelFormat::kUyvy),
    raw(V4L2_PIX_FMT_RGB24, "RGB24", PixelFormat::kRgb24),
    raw(V4L2_PIX_FMT_BGR24, "BGR24", PixelFormat::kBgr24),
    bayer(V4L2_PIX_FMT_SRGGB8, "SRGGB8", P::kRggb, B::k8),
    bayer(V4L2_PIX_FMT_SGRBG8, "SGRBG8", P::kGrbg, B::k8),
    bayer(V4L2_PIX_FMT_SGBRG8, "SGBRG8", P::kGbrg, B::k8),
    bayer(V4L2_PIX_FMT_SBGGR8, "SBGGR8", P::kBggr, B::k8),
    bayer(V4L2_PIX_FMT_SRGGB10P, "SRGGB10P", P::kRggb, B::kPacked10),
    bayer(V4L2_PIX_FMT_SGRBG10P, "SGRBG10P", P::kGrbg, B::kPacked10),
    bayer(V4L2_PIX_FMT_SGBRG10P, "SGBRG10P", P::kGbrg, B::kPacked10),
    bayer(V4L2_PIX_FMT_SBGGR10P, "SBGGR10P", P::kBggr, B::kPacked10),
    bayer(V4L2_PIX_FMT_SRGGB12P, "SRGGB12P", P::kRggb, B::kPacked12),
    bayer(V4L2_PIX_FMT_SGRBG12P, "SGRBG12P", P::kGrbg, B::kPacked12),
    bayer(V4L2_PIX_FMT_SGBRG12P, "SGBRG12P", P::kGbrg, B::kPacked12),
    bayer(V4L2_PIX_FMT_SBGGR12P, "SBGGR12P", P::kBggr, B::kPacked12),
    bayer(V4L2_PIX_FMT_SRGGB10, "SRGGB10", P::kRggb, B::k10),
    bayer(V4L2_PIX_FMT_SGRBG10, "SGRBG10", P::kGrbg, B::k10),
    bayer(V4L2_PIX_FMT_SGBRG10, "SGBRG10", P::kGbrg, B::k10),
    bayer(V4L2_PIX_FMT_SBGGR10, "SBGGR10", P::kBggr, B::k10),
    bayer(V4L2_PIX_FMT_SRGGB12, "SRGGB12", P::kRggb, B::k12),
    bayer(V4L2_PIX_FMT_SGRBG12, "SGRBG12", P::kGrbg, B::k12),
    bayer(V4L2_PIX_FMT_SGBRG12, "SGBRG12", P::kGbrg, B::k12),
    bayer(V4L2_PIX_FMT_SBGGR12, "SBGGR12", P::kBggr, B::k12),
    bayer(V4L2_PIX_FMT_SRGGB16, "SRGGB16", P::kRggb, B::k16),
    bayer(V4L2_PIX_FMT_SGRBG16, "SGRBG16", P::kGrbg, B::k16),
    bayer(V4L2_PIX_FMT_SGBRG16, "SGBRG16", P::kGbrg, B::k16),
    bayer(V4L2_PIX_FMT_SBGGR16, "SBGGR16", P::kBggr, B::k16),
    raw(V4L2_PIX_FMT_GREY, "GREY", PixelFormat::kGrey),
    raw(V4L2_PIX_FMT_Y10, "Y10", PixelFormat::kY10),
    raw(V4L2_PIX_FMT_Y12, "Y12", PixelFormat::kY12),
    raw(V4L2_PIX_FMT_Y16, "Y16", PixelFormat::kY16),
    V4l2Format{V4L2_PIX_FMT_MJPEG, "MJPEG", V4l2Kind::kMjpeg, PixelFormat::kMjpeg},
    V4l2Format{V4L2_PIX_FMT_JPEG, "JPEG", V4l2Kind::kMjpeg, PixelFormat::kMjpeg},
    V4l2Format{V4L2_PIX_FMT_H264, "H264", V4l2Kind::kH264, PixelFormat::kH264},
};

std::string upper(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return result;
}

}  // namespace

std::span<const V4l2Format> v4l2_formats() { return kFormats; }

const V4l2Format* find_v4l2_format(uint32_t fourcc) {
  const auto* const found = std::find_if(kFormats.begin(), kFormats.end(),
                                         [&](const auto& f) { return f.fourcc == fourcc; });
  return found == kFormats.end() ? nullptr : found;
}

const V4l2Format* find_v4l2_format(std::string_view name) {
  // Four characters first: case tells "pGAA" (SGBRG10P) from "pgAA" (SGRBG10P).
  for (const V4l2Format& format : kFormats) {
    if (fourcc_text(format.fourcc) == name) return &format;
  }
  std::string wanted = upper(name);
  if (wanted == "I420") wanted = "YUV420";
  if (wanted == "MJPG") wanted = "MJPEG";
  if (wanted == "YUY2") wanted = "YUYV";
  for (const V4l2Format& format : kFormats) {
    if (format.name == wanted) return &format;
  }
  return nullptr;
}

std::string fourcc_text(uint32_t fourcc) {
  std::string text;
  for (unsigned i = 0; i < 4; ++i) {
    const auto c = static_cast<char>(fourcc >> (8 * i) & 0x7f);
    text += c > ' ' && c < 0x7f ? c : ' ';
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

std::string v4l2_format_name(uint32_t fourcc) {
  const V4l2Format* const format = find_v4l2_format(fourcc);
  return format ? std::string(format->name) : fourcc_text(fourcc);
}

}  // namespace sightline
