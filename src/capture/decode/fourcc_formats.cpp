// SPDX-License-Identifier: Apache-2.0
#include "capture/decode/fourcc_formats.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cctype>

namespace sightline::capture {
namespace {

constexpr FourccFormat raw(uint32_t fourcc, std::string_view name, PixelFormat pixels) {
  return {fourcc, name, FormatKind::kRaw, pixels};
}
constexpr FourccFormat bayer(uint32_t fourcc, std::string_view name, MosaicPattern pattern,
                             BayerPacking packing) {
  return {fourcc, name, FormatKind::kBayer, PixelFormat::kI420, pattern, packing};
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
    raw(V4L2_PIX_FMT_GREY, "GREY", PixelFormat::kGray),
    raw(V4L2_PIX_FMT_Y10, "Y10", PixelFormat::kY10),
    raw(V4L2_PIX_FMT_Y12, "Y12", PixelFormat::kY12),
    raw(V4L2_PIX_FMT_Y16, "Y16", PixelFormat::kY16),
    FourccFormat{V4L2_PIX_FMT_MJPEG, "MJPEG", FormatKind::kMjpeg, PixelFormat::kMjpeg},
    FourccFormat{V4L2_PIX_FMT_JPEG, "JPEG", FormatKind::kMjpeg, PixelFormat::kMjpeg},
    FourccFormat{V4L2_PIX_FMT_H264, "H264", FormatKind::kH264, PixelFormat::kH264},
};

std::string upper(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return result;
}

}  // namespace

std::span<const FourccFormat> fourcc_formats() { return kFormats; }

const FourccFormat* find_fourcc_format(uint32_t fourcc) {
  const auto* const found = std::find_if(kFormats.begin(), kFormats.end(),
                                         [&](const auto& f) { return f.fourcc == fourcc; });
  return found == kFormats.end() ? nullptr : found;
}

const FourccFormat* find_fourcc_format(std::string_view name) {
  // Four characters first: case tells "pGAA" (SGBRG10P) from "pgAA" (SGRBG10P).
  for (const FourccFormat& format : kFormats) {
    if (fourcc_text(format.fourcc) == name) return &format;
  }
  std::string usual = upper(name);
  if (usual == "I420") usual = "YUV420";
  if (usual == "MJPG") usual = "MJPEG";
  if (usual == "YUY2") usual = "YUYV";
  for (const FourccFormat& format : kFormats) {
    if (format.name == usual) return &format;
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

std::string fourcc_name(uint32_t fourcc) {
  const FourccFormat* const format = find_fourcc_format(fourcc);
  return format ? std::string(format->name) : fourcc_text(fourcc);
}

}  // namespace sightline::capture
