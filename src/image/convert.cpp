// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/convert.hpp"

#include <libyuv/convert.h>
#include <libyuv/convert_from.h>
#include <libyuv/convert_from_argb.h>
#include <libyuv/planar_functions.h>
#include <libyuv/scale.h>

#include <algorithm>
#include <cstring>

#include "sightline/base/check.hpp"

namespace sightline {
namespace {

constexpr int kMaxSide = 32768;
constexpr uint8_t kNeutralChroma = 128;

int to_int(ptrdiff_t n) { return static_cast<int>(n); }

// Where the planes of a raw image lie. `second` and `third` are chroma; 0 rows where absent.
struct RawLayout {
  ptrdiff_t stride = 0;    // of the first plane
  ptrdiff_t row = 0;       // bytes used in a row of it
  ptrdiff_t stride_2 = 0;  // of each chroma plane
  ptrdiff_t row_2 = 0;
  int chroma_planes = 0;
};

Result<RawLayout> layout_of(PixelFormat format, int width, int height, ptrdiff_t stride) {
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    return make_error(ErrorCode::kInvalidInput, "", "image size {}x{} is outside 1..{}", width,
                      height, kMaxSide);
  }
  const ptrdiff_t half = (width + 1) / 2;
  RawLayout layout;
  switch (format) {
    case PixelFormat::kI420:
      layout = {stride ? stride : width, width, stride ? (stride + 1) / 2 : half, half, 2};
      break;
    case PixelFormat::kNv12:
      layout = {stride ? stride : width, width, stride ? stride : 2 * half, 2 * half, 1};
      break;
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy:
      layout = {stride ? stride : 4 * half, 4 * half, 0, 0, 0};
      break;
    case PixelFormat::kGray:
      layout = {stride ? stride : width, width, 0, 0, 0};
      break;
    case PixelFormat::kY10:
    case PixelFormat::kY12:
    case PixelFormat::kY16:
      layout = {stride ? stride : 2 * width, 2 * width, 0, 0, 0};
      break;
    case PixelFormat::kRgb24:
    case PixelFormat::kBgr24:
      layout = {stride ? stride : 3 * width, 3 * width, 0, 0, 0};
      break;
    case PixelFormat::kMjpeg:
    case PixelFormat::kH264:
      return make_error(ErrorCode::kInvalidInput, "",
                        "{} is compressed: it needs a decoder, not a conversion",
                        to_string(format));
  }
  if (layout.stride < layout.row || layout.stride_2 < layout.row_2 ||
      layout.stride > ptrdiff_t{1} << 20) {
    return make_error(ErrorCode::kInvalidInput, "",
                      "{} rows of {} pixels need {} bytes, but the stride is {}", to_string(format),
                      width, std::max(layout.row, layout.row_2), stride);
  }
  return layout;
}

ptrdiff_t bytes_needed(const RawLayout& layout, int height) {
  if (layout.chroma_planes == 0) return layout.stride * (height - 1) + layout.row;
  const ptrdiff_t rows_2 = (height + 1) / 2;
  return layout.stride * height + layout.stride_2 * (layout.chroma_planes * rows_2 - 1) +
         layout.row_2;
}

// Full range 0..255 into the 16..235 of BT.601, rounded.
constexpr uint8_t compress_range(uint32_t value) {
  return static_cast<uint8_t>(16u + (value * 219u + 127u) / 255u);
}

void gray_row(const uint8_t* from, uint8_t* to, int width) {
  for (int x = 0; x < width; ++x) to[x] = compress_range(from[x]);
}

void deep_gray_row(const uint8_t* from, uint8_t* to, int width, unsigned shift) {
  for (int x = 0; x < width; ++x) {
    const uint32_t value = from[2 * x] | static_cast<uint32_t>(from[2 * x + 1]) << 8;
    to[x] = compress_range(std::min(value >> shift, 255u));
  }
}

void fill(const MutablePlaneView& plane, uint8_t value) {
  for (int y = 0; y < plane.height; ++y) {
    std::memset(plane.row(y), value, static_cast<size_t>(plane.width));
  }
}

void gray_to_i420(PixelFormat format, const uint8_t* from, ptrdiff_t stride,
                  const MutableI420View& to) {
  const unsigned shift = format == PixelFormat::kY10 ? 2 : format == PixelFormat::kY12 ? 4 : 8;
  for (int y = 0; y < to.height(); ++y) {
    if (format == PixelFormat::kGray) {
      gray_row(from + y * stride, to.y.row(y), to.width());
    } else {
      deep_gray_row(from + y * stride, to.y.row(y), to.width(), shift);
    }
  }
  fill(to.u, kNeutralChroma);
  fill(to.v, kNeutralChroma);
}

using PackedToI420 = int (*)(const uint8_t*, int, uint8_t*, int, uint8_t*, int, uint8_t*, int, int,
                             int);

int packed_to_i420(PackedToI420 convert, const uint8_t* from, ptrdiff_t stride,
                   const MutableI420View& to) {
  return convert(from, to_int(stride), to.y.data, to_int(to.y.stride), to.u.data,
                 to_int(to.u.stride), to.v.data, to_int(to.v.stride), to.width(), to.height());
}

}  // namespace

std::string_view to_string(PixelFormat format) {
  switch (format) {
    case PixelFormat::kI420:
      return "I420";
    case PixelFormat::kNv12:
      return "NV12";
    case PixelFormat::kYuyv:
      return "YUYV";
    case PixelFormat::kUyvy:
      return "UYVY";
    case PixelFormat::kGray:
      return "GREY";
    case PixelFormat::kY10:
      return "Y10";
    case PixelFormat::kY12:
      return "Y12";
    case PixelFormat::kY16:
      return "Y16";
    case PixelFormat::kRgb24:
      return "RGB24";
    case PixelFormat::kBgr24:
      return "BGR24";
    case PixelFormat::kMjpeg:
      return "MJPEG";
    case PixelFormat::kH264:
      return "H.264";
  }
  return "unknown";
}

void copy_i420(const I420View& from, const MutableI420View& to) {
  SL_CHECK(from.width() == to.width() && from.height() == to.height(), "sizes differ");
  libyuv::I420Copy(from.y.data, to_int(from.y.stride), from.u.data, to_int(from.u.stride),
                   from.v.data, to_int(from.v.stride), to.y.data, to_int(to.y.stride), to.u.data,
                   to_int(to.u.stride), to.v.data, to_int(to.v.stride), to.width(), to.height());
}

Result<size_t> raw_image_bytes(PixelFormat format, int width, int height, ptrdiff_t stride) {
  SL_ASSIGN(const RawLayout layout, layout_of(format, width, height, stride));
  return static_cast<size_t>(bytes_needed(layout, height));
}

Status raw_to_i420(PixelFormat format, std::span<const uint8_t> bytes, ptrdiff_t stride,
                   const MutableI420View& to) {
  const int width = to.width(), height = to.height();
  SL_ASSIGN(const RawLayout layout, layout_of(format, width, height, stride));
  const auto needed = static_cast<size_t>(bytes_needed(layout, height));
  if (bytes.size() < needed) {
    return make_error(ErrorCode::kDamaged, "", "a {}x{} {} image needs {} bytes, {} came", width,
                      height, to_string(format), needed, bytes.size());
  }
  const uint8_t* const first = bytes.data();
  const ptrdiff_t chroma_rows = (height + 1) / 2;
  const uint8_t* const second = first + layout.stride * height;
  int failed = 0;
  switch (format) {
    case PixelFormat::kI420: {
      const uint8_t* const third = second + layout.stride_2 * chroma_rows;
      failed =
          libyuv::I420Copy(first, to_int(layout.stride), second, to_int(layout.stride_2), third,
                           to_int(layout.stride_2), to.y.data, to_int(to.y.stride), to.u.data,
                           to_int(to.u.stride), to.v.data, to_int(to.v.stride), width, height);
      break;
    }
    case PixelFormat::kNv12:
      failed = libyuv::NV12ToI420(first, to_int(layout.stride), second, to_int(layout.stride_2),
                                  to.y.data, to_int(to.y.stride), to.u.data, to_int(to.u.stride),
                                  to.v.data, to_int(to.v.stride), width, height);
      break;
    case PixelFormat::kYuyv:
      failed = packed_to_i420(&libyuv::YUY2ToI420, first, layout.stride, to);
      break;
    case PixelFormat::kUyvy:
      failed = packed_to_i420(&libyuv::UYVYToI420, first, layout.stride, to);
      break;
    case PixelFormat::kRgb24:  // libyuv names byte orders as a little-endian word would read
      failed = packed_to_i420(&libyuv::RAWToI420, first, layout.stride, to);
      break;
    case PixelFormat::kBgr24:
      failed = packed_to_i420(&libyuv::RGB24ToI420, first, layout.stride, to);
      break;
    default:
      gray_to_i420(format, first, layout.stride, to);
      break;
  }
  if (failed != 0) {
    return make_error(ErrorCode::kInternal, "", "libyuv refused a {}x{} {} image", width, height,
                      to_string(format));
  }
  return {};
}

void i420_to_rgb(const I420View& from, uint8_t* rgb) {
  libyuv::I420ToRAW(from.y.data, to_int(from.y.stride), from.u.data, to_int(from.u.stride),
                    from.v.data, to_int(from.v.stride), rgb, from.width() * 3, from.width(),
                    from.height());
}

void fill_plane(const MutablePlaneView& plane, uint8_t value) {
  for (int y = 0; y < plane.height; ++y) {
    std::memset(plane.row(y), value, static_cast<size_t>(plane.width));
  }
}

void halve_plane(const PlaneView& from, const MutablePlaneView& to) { shrink_plane(from, 2, to); }

void shrink_plane(const PlaneView& from, int factor, const MutablePlaneView& to) {
  SL_CHECK(to.width == from.width / factor && to.height == from.height / factor,
           "not that share of the size");
  if (to.width == 0 || to.height == 0) return;
  // What is left of a last row or column takes no part; of whole squares, libyuv's box filter is
  // the mean.
  libyuv::ScalePlane(from.data, to_int(from.stride), factor * to.width, factor * to.height, to.data,
                     to_int(to.stride), to.width, to.height, libyuv::kFilterBox);
}

}  // namespace sightline
