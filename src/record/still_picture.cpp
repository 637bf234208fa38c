// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/still_picture.hpp"

#include <cstring>

#include "av.hpp"
#include "sightline/base/files.hpp"
#include "to_picture.hpp"

namespace sightline {
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
  if (starts("RIFF"sv) && bytes.substr(8, 4) == "WEBP"sv) return AV_CODEC_ID_WEBP;
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

}  // namespace

Result<std::shared_ptr<const Picture>> parse_picture(std::string_view bytes,
                                                     const std::string& where) {
  av::quiet();
  const AVCodecID id = codec_of(bytes);
  if (id == AV_CODEC_ID_NONE) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "is none of PNG, JPEG, BMP, TIFF, PNM, WebP");
  }
  SL_ASSIGN(const av::CodecPtr decoder, open_decoder(id, where));
  SL_ASSIGN(const av::AvFramePtr frame, decode(bytes, *decoder, where));
  if (frame->width < 1 || frame->height < 1 || frame->width > kLongestSide ||
      frame->height > kLongestSide) {
    return make_error(ErrorCode::kInvalidInput, where, "is {} x {} pixels", frame->width,
                      frame->height);
  }
  auto picture = std::make_shared<Picture>(frame->width, frame->height);
  SL_RETURN_IF_ERROR(ToPicture().convert(*frame, *picture, where));
  return std::shared_ptr<const Picture>(std::move(picture));
}

Result<std::shared_ptr<const Picture>> read_picture(const std::filesystem::path& path) {
  SL_ASSIGN(const std::string bytes, read_file(path));
  return parse_picture(bytes, path.string());
}

}  // namespace sightline
