// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "capture/aravis/genicam_formats.hpp"
#include "capture/common/bytes_pool.hpp"
#include "capture/decode/bayer_decoder.hpp"
#include "sightline/image/image.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::capture {

/// Makes frames of one format and size from the buffers of a GenICam camera: as they are, unpacked
/// to 16-bit words, or demosaiced to I420.
class GenicamImage {
 public:
  /// `padding`: bytes after each row. The row must end on a byte (genicam_row_bytes() > 0).
  GenicamImage(const GenicamFormat& format, int width, int height, int padding);

  const GenicamFormat& format() const { return *format_; }
  int width() const { return width_; }
  int height() const { return height_; }
  int padding() const { return padding_; }
  /// Bytes that a complete image has at least.
  size_t bytes_needed() const;

  /// `bytes` holds bytes_needed(); `owner` keeps them, and is dropped before this returns where the
  /// frame does not need them any more.
  FramePtr frame(FrameInfo info, std::span<const uint8_t> bytes, std::shared_ptr<const void> owner);
  /// The same, of a copy of the bytes.
  FramePtr copied_frame(const FrameInfo& info, std::span<const uint8_t> bytes);

 private:
  FramePtr unpacked(const FrameInfo& info, const uint8_t* bytes);
  FramePtr demosaiced(const FrameInfo& info, std::span<const uint8_t> bytes);
  void unpack(const uint8_t* bytes, uint8_t* words) const;

  const GenicamFormat* format_;
  int width_, height_, padding_;
  ptrdiff_t stride_;
  std::shared_ptr<ImagePool> images_;
  BytesPool copies_, words_;
  std::unique_ptr<BayerDecoder> bayer_;  ///< of Bayer formats
  std::vector<uint8_t> mosaic_;          ///< words, of packed Bayer formats
};

}  // namespace sightline::capture
