// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/still_image.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "record/media/av.hpp"
#include "record/media/exr.hpp"
#include "record/media/to_image.hpp"
#include "sightline/base/files.hpp"

namespace sightline {

using namespace record;

namespace {

using namespace std::string_view_literals;

constexpr int kLongestSide = 32768;

AVCodecID codec_of(std::string_view bytes) {
  const auto starts = [&](std::string_view magic) {
    return bytes.substr(0, magic.size()) == magic;
  };
  if (starts("\x89PNG\r\n\x1a\n"sv)) return AV_CODEC_ID_PNG;
  if (starts("\xff\xd8\xff"sv)) return AV_CODEC_ID_MJPEG;
  if (starts("BM"sv)) return AV_CODEC_ID_BMP;
  if (starts("II*\0"sv) || starts("MM\0*"sv)) return AV_CODEC_ID_TIFF;
  if (starts("P5"sv)) return AV_CODEC_ID_PGM;
  if (starts("P6"sv)) return AV_CODEC_ID_PPM;
  if (starts("RIFF"sv) && bytes.size() >= 12 && bytes.substr(8, 4) == "WEBP"sv)
    return AV_CODEC_ID_WEBP;
  return AV_CODEC_ID_NONE;
}

Result<av::CodecPtr> open_decoder(AVCodecID id, const std::string& where) {
  const AVCodec* codec = avcodec_find_decoder(id);
  if (codec == nullptr) {
    return make_error(ErrorCode::kUnavailable, where, "this libavcodec has no decoder for {}",
                      avcodec_get_name(id));
  }
  av::CodecPtr context(avcodec_alloc_context3(codec));
  SL_CHECK(context != nullptr, "out of memory");
  context->thread_count = 1;
  context->err_recognition = AV_EF_EXPLODE;  // half an image is no image
  context->max_pixels = int64_t{kLongestSide} * kLongestSide / 4;
  const int code = avcodec_open2(context.get(), codec, nullptr);
  if (code < 0) return av::error(where, "start the decoder", code);
  return context;
}

Result<av::AvFramePtr> decode(std::string_view bytes, AVCodecContext& decoder,
                              const std::string& where) {
  av::PacketPtr packet(av_packet_alloc());
  av::AvFramePtr frame(av_frame_alloc());
  SL_CHECK(packet && frame, "out of memory");
  int code = av_new_packet(packet.get(), static_cast<int>(bytes.size()));
  if (code < 0) return av::error(where, "hold the image", code);
  std::memcpy(packet->data, bytes.data(), bytes.size());
  code = avcodec_send_packet(&decoder, packet.get());
  if (code >= 0) code = avcodec_send_packet(&decoder, nullptr);
  if (code >= 0) code = avcodec_receive_frame(&decoder, frame.get());
  if (code >= 0) return frame;
  return make_error(ErrorCode::kDamaged, where, "cannot decode the {} image: {}",
                    avcodec_get_name(decoder.codec_id), av::error_text(code));
}

Result<av::AvFramePtr> decode_any(std::string_view bytes, const std::string& where,
                                  std::string_view known) {
  av::quiet();
  const AVCodecID id = codec_of(bytes);
  if (id == AV_CODEC_ID_NONE) {
    return make_error(ErrorCode::kInvalidInput, where, "is none of {}", known);
  }
  SL_ASSIGN(const av::CodecPtr decoder, open_decoder(id, where));
  SL_ASSIGN(av::AvFramePtr frame, decode(bytes, *decoder, where));
  if (frame->width < 1 || frame->height < 1 || frame->width > kLongestSide ||
      frame->height > kLongestSide) {
    return make_error(ErrorCode::kInvalidInput, where, "is {} x {} pixels", frame->width,
                      frame->height);
  }
  return frame;
}

// Reads the x-th number of a row of a depth image.
using DepthReader = float (*)(const uint8_t* row, int x);

template <typename Number, bool kBigEndian>
float read_number(const uint8_t* row, int x) {
  std::array<uint8_t, sizeof(Number)> bytes;
  std::memcpy(bytes.data(), row + sizeof(Number) * static_cast<size_t>(x), sizeof(Number));
  if ((std::endian::native == std::endian::big) != kBigEndian) {
    std::reverse(bytes.begin(), bytes.end());
  }
  return static_cast<float>(std::bit_cast<Number>(bytes));
}

DepthReader depth_reader(int format) {
  switch (format) {
    case AV_PIX_FMT_GRAY16LE:
      return read_number<uint16_t, false>;
    case AV_PIX_FMT_GRAY16BE:
      return read_number<uint16_t, true>;
    case AV_PIX_FMT_GRAYF32LE:
      return read_number<float, false>;
    case AV_PIX_FMT_GRAYF32BE:
      return read_number<float, true>;
    default:
      return nullptr;
  }
}

/// The numbers of a gray image, as they are.
Result<DepthImage> read_gray(std::string_view bytes, const std::string& where) {
  SL_ASSIGN(const av::AvFramePtr frame,
            decode_any(bytes, where, "16-bit PNG, 16-bit TIFF, OpenEXR"));
  const DepthReader read = depth_reader(frame->format);
  if (read == nullptr) {
    const char* name = av_get_pix_fmt_name(static_cast<AVPixelFormat>(frame->format));
    return make_error(ErrorCode::kInvalidInput, where,
                      "holds {} pixels; a depth image is 16-bit gray or floating point",
                      name != nullptr ? name : "unknown");
  }
  DepthImage image{frame->width, frame->height, {}};
  image.depth.reserve(static_cast<size_t>(frame->width) * static_cast<size_t>(frame->height));
  for (int y = 0; y < frame->height; ++y) {
    const uint8_t* row = frame->data[0] + ptrdiff_t{y} * frame->linesize[0];
    for (int x = 0; x < frame->width; ++x) image.depth.push_back(read(row, x));
  }
  return image;
}

}  // namespace

Result<std::shared_ptr<const Image>> parse_image(std::string_view bytes, const std::string& where) {
  SL_ASSIGN(const av::AvFramePtr frame,
            decode_any(bytes, where, "PNG, JPEG, BMP, TIFF, PNM, WebP"));
  auto image = std::make_shared<Image>(frame->width, frame->height);
  SL_RETURN_IF_ERROR(ToImage().convert(*frame, *image, where));
  return std::shared_ptr<const Image>(std::move(image));
}

Result<std::shared_ptr<const Image>> read_image(const std::filesystem::path& path) {
  SL_ASSIGN(const std::string bytes, read_file(path));
  return parse_image(bytes, path.string());
}

Result<DepthImage> parse_depth_image(std::string_view bytes, const std::string& where,
                                     double meters_per_unit) {
  SL_ASSIGN(DepthImage image,
            record::is_exr(bytes) ? record::read_exr_depth(bytes, where) : read_gray(bytes, where));
  const auto scale = static_cast<float>(meters_per_unit);
  bool any = false;
  for (float& depth : image.depth) {
    depth *= scale;
    const bool surface = std::isfinite(depth) && depth > 0;
    any = any || surface;
    if (!surface) depth = 0;
  }
  if (any) return image;
  return make_error(ErrorCode::kInvalidInput, where, "holds no depth: every pixel is 0");
}

Result<DepthImage> read_depth_image(const std::filesystem::path& path, double meters_per_unit) {
  SL_ASSIGN(const std::string bytes, read_file(path));
  return parse_depth_image(bytes, path.string(), meters_per_unit);
}

}  // namespace sightline
