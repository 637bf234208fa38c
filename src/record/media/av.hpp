// SPDX-License-Identifier: Apache-2.0
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/frame.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
}

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::record::av {

template <auto Free>
struct Freer {
  template <typename T>
  void operator()(T* object) const {
    Free(&object);
  }
};
using InputPtr = std::unique_ptr<AVFormatContext, Freer<avformat_close_input>>;
using CodecPtr = std::unique_ptr<AVCodecContext, Freer<avcodec_free_context>>;
using PacketPtr = std::unique_ptr<AVPacket, Freer<av_packet_free>>;
using AvFramePtr = std::unique_ptr<AVFrame, Freer<av_frame_free>>;

/// libav's words for one of its error numbers.
std::string error_text(int code);

/// "cannot TRIED: REASON" for a libav error number.
Error error(const std::string& where, std::string_view tried, int code);

/// Sends libav's own messages to log::debug: what matters of them comes back as an Error.
void quiet();

/// AV_CODEC_ID_NONE if unknown.
AVCodecID codec_id(std::string_view recording_codec);

/// Raw images, as cameras give and libavcodec names them; nullopt for the compressed ones.
std::optional<AVPixelFormat> to_av(PixelFormat format);
std::optional<PixelFormat> from_av(AVPixelFormat format);

/// The video stream of a Matroska file.
class Demuxer {
 public:
  /// Refuses a file without exactly one video stream, or with another codec or size.
  static Result<Demuxer> open(const std::filesystem::path& file, const std::string& codec,
                              int width, int height);

  /// Fills `packet` with the next image's bytes; false at the end.
  Result<bool> read(AVPacket* packet);
  const AVCodecParameters& parameters() const { return *stream_->codecpar; }
  const std::string& where() const { return where_; }

 private:
  Demuxer(InputPtr input, AVStream* stream, std::string where)
      : input_(std::move(input)), stream_(stream), where_(std::move(where)) {}
  InputPtr input_;
  AVStream* stream_;
  std::string where_;
};

}  // namespace sightline::record::av
