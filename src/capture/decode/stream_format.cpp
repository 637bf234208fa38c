// SPDX-License-Identifier: Apache-2.0
#include "capture/decode/stream_format.hpp"

#include <algorithm>
#include <utility>

#include "capture/decode/bayer_decoder.hpp"
#include "capture/decode/h264_decoder.hpp"
#include "capture/decode/mjpeg_decoder.hpp"
#include "sightline/image/convert.hpp"

namespace sightline::capture {
namespace {

class MjpegImages final : public ImageDecoder {
 public:
  Status decode(std::span<const uint8_t> bytes, const MutableI420View& to) override {
    return decoder_.decode(bytes, to);
  }
  std::span<const uint8_t> payload(std::span<const uint8_t> bytes) const override {
    return trim_jpeg(bytes);
  }

 private:
  MjpegDecoder decoder_;
};

class BayerImages final : public ImageDecoder {
 public:
  explicit BayerImages(const StreamFormat& stream)
      : decoder_(stream.format->pattern, stream.format->packing, stream.layout.width,
                 stream.layout.height),
        stride_(stream.layout.stride) {}

  Status decode(std::span<const uint8_t> bytes, const MutableI420View& to) override {
    return decoder_.decode(bytes, stride_, to);
  }
  std::span<const uint8_t> payload(std::span<const uint8_t>) const override { return {}; }

 private:
  BayerDecoder decoder_;
  const ptrdiff_t stride_;
};

}  // namespace

Result<StreamFormat> stream_format(const FourccFormat& format, int width, int height,
                                   ptrdiff_t stride) {
  StreamFormat stream;
  stream.format = &format;
  stream.layout.pixels = format.pixels;
  stream.layout.width = width;
  stream.layout.height = height;
  if (format.kind == FormatKind::kRaw) {
    stream.layout.stride = stride;
    SL_ASSIGN(stream.layout.image_bytes, raw_image_bytes(format.pixels, width, height, stride));
  } else if (format.kind == FormatKind::kBayer) {
    const size_t row = bayer_row_bytes(format.packing, width);
    stream.layout.stride = std::max(static_cast<ptrdiff_t>(row), stride);
    stream.layout.image_bytes =
        static_cast<size_t>(stream.layout.stride) * static_cast<size_t>(height - 1) + row;
  }
  return stream;
}

Result<FrameDecoders> make_decoders(const StreamFormat& stream, const std::string& where) {
  FrameDecoders decoders;
  switch (stream.format->kind) {
    case FormatKind::kRaw:
      break;
    case FormatKind::kBayer:
      decoders.image = std::make_unique<BayerImages>(stream);
      break;
    case FormatKind::kMjpeg:
      decoders.image = std::make_unique<MjpegImages>();
      break;
    case FormatKind::kH264:
      SL_ASSIGN(decoders.access_unit,
                H264Decoder::create(stream.layout.width, stream.layout.height, where));
      break;
  }
  return decoders;
}

}  // namespace sightline::capture
