// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace sightline {

/// One 8-bit plane that somebody else owns. Rows are `stride` bytes apart.
template <typename Byte>
struct BasicPlane {
  Byte* data = nullptr;
  int width = 0;
  int height = 0;
  ptrdiff_t stride = 0;

  Byte* row(int y) const { return data + y * stride; }
};
using PlaneView = BasicPlane<const uint8_t>;
using MutablePlaneView = BasicPlane<uint8_t>;

inline PlaneView as_const(MutablePlaneView p) { return {p.data, p.width, p.height, p.stride}; }

/// Full luma and quarter-size chroma, BT.601 limited range unless said otherwise; chroma planes are
/// (width + 1) / 2 by (height + 1) / 2.
template <typename Byte>
struct BasicI420 {
  BasicPlane<Byte> y, u, v;
  int width() const { return y.width; }
  int height() const { return y.height; }
};
using I420View = BasicI420<const uint8_t>;
using MutableI420View = BasicI420<uint8_t>;

inline I420View as_const(MutableI420View p) {
  return {as_const(p.y), as_const(p.u), as_const(p.v)};
}

/// Luma and interleaved chroma (u0 v0 u1 v1 ...); `uv.width` counts bytes.
template <typename Byte>
struct BasicNv12 {
  BasicPlane<Byte> y, uv;
};
using Nv12View = BasicNv12<const uint8_t>;
using MutableNv12View = BasicNv12<uint8_t>;

enum class PixelFormat : uint8_t {
  kI420,
  kNv12,
  kYuyv,
  kUyvy,
  kGray,
  kY10,
  kY12,
  kY16,
  kRgb24,
  kBgr24,
  kMjpeg,
  kH264,
};

}  // namespace sightline
