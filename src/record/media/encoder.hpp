// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "record/media/av.hpp"
#include "record/media/video_file.hpp"

namespace sightline::record {

/// One libavcodec video encoder that works in the calling thread.
class Encoder {
 public:
  struct Settings {
    const AVCodec* codec = nullptr;
    AVPixelFormat format = AV_PIX_FMT_NONE;
    int width = 0;
    int height = 0;
    int gop = 1;
    std::vector<std::pair<const char*, const char*>> options;
  };
  static Result<std::unique_ptr<Encoder>> create(const Settings& settings,
                                                 const std::string& where);

  /// A writable frame of the encoder's format and size.
  Result<AVFrame*> frame();
  /// Encodes frame() at `ms`, and gives every packet that comes out to `sink`.
  using Sink = std::function<Status(AVPacket*)>;
  Status encode(int64_t ms, const Sink& sink);
  Status finish(const Sink& sink);
  ParametersPtr parameters() const;

 private:
  explicit Encoder(std::string where) : where_(std::move(where)) {}
  Status send(const AVFrame* frame, const Sink& sink);

  std::string where_;
  av::CodecPtr context_;
  av::AvFramePtr frame_;
  av::PacketPtr packet_;
};

}  // namespace sightline::record
