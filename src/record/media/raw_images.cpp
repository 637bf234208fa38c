// SPDX-License-Identifier: Apache-2.0
#include "record/media/raw_images.hpp"

#include <cstring>

#include "sightline/image/convert.hpp"

namespace sightline::record {
namespace {

/// Appends `rows` rows of `bytes` each, `stride` apart, and returns where the next plane starts.
const uint8_t* append_rows(const uint8_t* from, ptrdiff_t stride, ptrdiff_t bytes, int rows,
                           std::vector<uint8_t>& out) {
  if (stride == bytes) {
    out.insert(out.end(), from, from + bytes * rows);
    return from + rows * stride;
  }
  for (int y = 0; y < rows; ++y) {
    const uint8_t* row = from + y * stride;
    out.insert(out.end(), row, row + bytes);
  }
  return from + rows * stride;
}

/// Copies a tight plane into an encoder's plane, and returns the end of the tight one.
const uint8_t* copy_plane(const uint8_t* from, int width, int height, uint8_t* to, int stride) {
  for (int y = 0; y < height; ++y) {
    std::memcpy(to + ptrdiff_t{y} * stride, from, static_cast<size_t>(width));
    from += width;
  }
  return from;
}

void pack_i420(const I420View& view, std::vector<uint8_t>& out) {
  for (const auto& plane : {view.y, view.u, view.v}) {
    append_rows(plane.data, plane.stride, plane.width, plane.height, out);
  }
}

/// Where the two luma and the two chroma bytes of a packed pair of pixels are.
struct PairLayout {
  int y0, y1, u, v;
};
constexpr PairLayout kYuyvLayout{0, 2, 1, 3};
constexpr PairLayout kUyvyLayout{1, 3, 0, 2};

void unpack_422(const uint8_t* from, const PairLayout& at, AVFrame& frame) {
  const int pairs = (frame.width + 1) / 2;
  for (int y = 0; y < frame.height; ++y) {
    uint8_t* const luma = frame.data[0] + ptrdiff_t{y} * frame.linesize[0];
    uint8_t* const u = frame.data[1] + ptrdiff_t{y} * frame.linesize[1];
    uint8_t* const v = frame.data[2] + ptrdiff_t{y} * frame.linesize[2];
    for (int x = 0; x < pairs; ++x, from += 4) {
      luma[2 * x] = from[at.y0];
      if (2 * x + 1 < frame.width) luma[2 * x + 1] = from[at.y1];
      u[x] = from[at.u];
      v[x] = from[at.v];
    }
  }
}

void fill_nv12(const uint8_t* from, AVFrame& frame) {
  from = copy_plane(from, frame.width, frame.height, frame.data[0], frame.linesize[0]);
  for (int y = 0; y < (frame.height + 1) / 2; ++y) {
    uint8_t* const u = frame.data[1] + ptrdiff_t{y} * frame.linesize[1];
    uint8_t* const v = frame.data[2] + ptrdiff_t{y} * frame.linesize[2];
    for (int x = 0; x < (frame.width + 1) / 2; ++x, from += 2) {
      u[x] = from[0];
      v[x] = from[1];
    }
  }
}

}  // namespace

Result<std::span<const uint8_t>> tight_raw_image(const Frame& frame, PixelFormat format,
                                                 std::vector<uint8_t>& scratch) {
  const FrameInfo& info = frame.info();
  const FramePayload& payload = frame.payload();
  scratch.clear();
  const bool other_payload = format == PixelFormat::kI420 && info.format != PixelFormat::kI420;
  if (payload.bytes.empty() || other_payload) {
    pack_i420(frame.i420(), scratch);
    return std::span<const uint8_t>(scratch);
  }
  SL_ASSIGN(const size_t tight, raw_image_bytes(format, info.width, info.height, 0));
  SL_ASSIGN(const size_t row, raw_image_bytes(format, info.width, 1, 0));
  const bool planar = format == PixelFormat::kI420 || format == PixelFormat::kNv12;
  const auto row_bytes = planar ? ptrdiff_t{info.width} : static_cast<ptrdiff_t>(row);
  if (payload.stride == 0 || payload.stride == row_bytes) return payload.bytes.first(tight);
  const int half_height = (info.height + 1) / 2;
  const ptrdiff_t half_width = (info.width + 1) / 2;
  const uint8_t* rest =
      append_rows(payload.bytes.data(), payload.stride, row_bytes, info.height, scratch);
  if (format == PixelFormat::kNv12) {
    append_rows(rest, payload.stride, 2 * half_width, half_height, scratch);
  } else if (format == PixelFormat::kI420) {
    const ptrdiff_t stride = (payload.stride + 1) / 2;
    rest = append_rows(rest, stride, half_width, half_height, scratch);
    append_rows(rest, stride, half_width, half_height, scratch);
  }
  return std::span<const uint8_t>(scratch);
}

std::optional<AVPixelFormat> planar_format(PixelFormat format) {
  switch (format) {
    case PixelFormat::kI420:
    case PixelFormat::kNv12:
      return AV_PIX_FMT_YUV420P;
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy:
      return AV_PIX_FMT_YUV422P;
    case PixelFormat::kGray:
      return AV_PIX_FMT_GRAY8;
    default:
      return std::nullopt;
  }
}

void fill_planar(PixelFormat format, std::span<const uint8_t> tight, AVFrame& frame) {
  const int half_width = (frame.width + 1) / 2, half_height = (frame.height + 1) / 2;
  const uint8_t* from = tight.data();
  switch (format) {
    case PixelFormat::kGray:
      copy_plane(from, frame.width, frame.height, frame.data[0], frame.linesize[0]);
      return;
    case PixelFormat::kI420:
      from = copy_plane(from, frame.width, frame.height, frame.data[0], frame.linesize[0]);
      from = copy_plane(from, half_width, half_height, frame.data[1], frame.linesize[1]);
      copy_plane(from, half_width, half_height, frame.data[2], frame.linesize[2]);
      return;
    case PixelFormat::kNv12:
      return fill_nv12(from, frame);
    case PixelFormat::kYuyv:
      return unpack_422(from, kYuyvLayout, frame);
    case PixelFormat::kUyvy:
      return unpack_422(from, kUyvyLayout, frame);
    default:
      SL_CHECK(false, "planar_format() has no format for this");
  }
}

}  // namespace sightline::record
