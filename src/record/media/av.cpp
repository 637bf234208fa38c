// SPDX-License-Identifier: Apache-2.0
#include "record/media/av.hpp"

extern "C" {
#include <libavutil/log.h>
}

#include <array>
#include <cstdarg>
#include <cstdio>
#include <mutex>

#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"

namespace sightline::record::av {
namespace {

struct FormatPair {
  PixelFormat ours;
  AVPixelFormat theirs;
};
constexpr std::array<FormatPair, 10> kFormats = {{
    {PixelFormat::kI420, AV_PIX_FMT_YUV420P},
    {PixelFormat::kNv12, AV_PIX_FMT_NV12},
    {PixelFormat::kYuyv, AV_PIX_FMT_YUYV422},
    {PixelFormat::kUyvy, AV_PIX_FMT_UYVY422},
    {PixelFormat::kGray, AV_PIX_FMT_GRAY8},
    {PixelFormat::kY10, AV_PIX_FMT_GRAY10LE},
    {PixelFormat::kY12, AV_PIX_FMT_GRAY12LE},
    {PixelFormat::kY16, AV_PIX_FMT_GRAY16LE},
    {PixelFormat::kRgb24, AV_PIX_FMT_RGB24},
    {PixelFormat::kBgr24, AV_PIX_FMT_BGR24},
}};

void forward_message(void*, int level, const char* format, va_list arguments) {
  if (level > AV_LOG_WARNING || log::level() > log::Level::kDebug) return;
  char line[512];
  std::vsnprintf(line, sizeof line, format, arguments);
  std::string_view text(line);
  while (text.ends_with('\n')) text.remove_suffix(1);
  log::debug("libav: {}", text);
}

/// Only the Matroska demuxer and plain files: a recording comes from anywhere.
Result<InputPtr> open_matroska(const std::string& where) {
  AVDictionary* options = nullptr;
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  AVFormatContext* input = nullptr;
  const int code = avformat_open_input(&input, ("file:" + where).c_str(),
                                       av_find_input_format("matroska"), &options);
  av_dict_free(&options);
  if (code < 0) return error(where, "open this video", code);
  return InputPtr(input);
}

Result<AVStream*> only_video(AVFormatContext& input, const std::string& where) {
  AVStream* found = nullptr;
  for (unsigned i = 0; i < input.nb_streams; ++i) {
    AVStream* stream = input.streams[i];
    if (stream->codecpar->codec_type != AVMEDIA_TYPE_VIDEO) {
      stream->discard = AVDISCARD_ALL;
      continue;
    }
    if (found) {
      return make_error(ErrorCode::kInvalidInput, where, "holds several video streams");
    }
    found = stream;
  }
  if (!found) return make_error(ErrorCode::kDamaged, where, "holds no video stream");
  return found;
}

}  // namespace

std::string error_text(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(code, text, sizeof text);
  return text;
}

Error error(const std::string& where, std::string_view tried, int code) {
  const ErrorCode kind = code == AVERROR(ENOENT)                              ? ErrorCode::kNotFound
                         : code == AVERROR_INVALIDDATA || code == AVERROR_EOF ? ErrorCode::kDamaged
                                                                              : ErrorCode::kIo;
  return make_error(kind, where, "cannot {}: {}", tried, error_text(code));
}

void quiet() {
  static std::once_flag once;
  std::call_once(once, [] { av_log_set_callback(forward_message); });
}

AVCodecID codec_id(std::string_view codec) {
  if (codec == "h264") return AV_CODEC_ID_H264;
  if (codec == "mpeg4") return AV_CODEC_ID_MPEG4;
  if (codec == "mjpeg") return AV_CODEC_ID_MJPEG;
  if (codec == "ffv1") return AV_CODEC_ID_FFV1;
  if (codec == "rawvideo") return AV_CODEC_ID_RAWVIDEO;
  return AV_CODEC_ID_NONE;
}

std::optional<AVPixelFormat> to_av(PixelFormat format) {
  for (const auto& pair : kFormats) {
    if (pair.ours == format) return pair.theirs;
  }
  return std::nullopt;
}

std::optional<PixelFormat> from_av(AVPixelFormat format) {
  for (const auto& pair : kFormats) {
    if (pair.theirs == format) return pair.ours;
  }
  return std::nullopt;
}

Result<Demuxer> Demuxer::open(const std::filesystem::path& file, const std::string& codec,
                              int width, int height) {
  quiet();
  const Waiting wait("the disk");
  const std::string where = file.string();
  SL_ASSIGN(InputPtr input, open_matroska(where));
  const int code = avformat_find_stream_info(input.get(), nullptr);
  if (code < 0) return error(where, "read the head of this video", code);
  SL_ASSIGN(AVStream * stream, only_video(*input, where));
  const AVCodecParameters& found = *stream->codecpar;
  if (found.codec_id != codec_id(codec)) {
    return make_error(ErrorCode::kInvalidInput, where, "holds {}, recording.toml says {}",
                      avcodec_get_name(found.codec_id), codec);
  }
  if (found.width != width || found.height != height) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "images are {} x {}, recording.toml says {} x {}", found.width, found.height,
                      width, height);
  }
  return Demuxer(std::move(input), stream, where);
}

Result<bool> Demuxer::read(AVPacket* packet) {
  for (;;) {
    av_packet_unref(packet);
    const int code = [&] {
      const Waiting wait("the disk");
      return av_read_frame(input_.get(), packet);
    }();
    if (code == AVERROR_EOF) return false;
    // A file that was cut inside a block: what came before it counts.
    if (code == AVERROR_INVALIDDATA || code == AVERROR(EIO)) return false;
    if (code < 0) return error(where_, "read this video", code);
    if (packet->stream_index == stream_->index && packet->size > 0) return true;
  }
}

}  // namespace sightline::record::av
