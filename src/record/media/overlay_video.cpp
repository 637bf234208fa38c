// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/overlay_video.hpp"

#include <algorithm>
#include <optional>

#include "record/media/encoder.hpp"
#include "record/media/to_image.hpp"
#include "sightline/base/files.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {

using namespace record;

namespace {

Result<Encoder::Settings> choose_encoder(const OverlayVideoOptions& options,
                                         const std::string& where) {
  Encoder::Settings settings;
  settings.format = AV_PIX_FMT_YUV420P;
  settings.width = options.width;
  settings.height = options.height;
  settings.gop = 60;
  settings.codec = avcodec_find_encoder_by_name("libx264");
  if (settings.codec) {
    settings.options = {{"preset", "veryfast"}, {"crf", "20"}, {"bf", "0"}};
    return settings;
  }
  settings.codec = avcodec_find_encoder(AV_CODEC_ID_MPEG4);
  if (settings.codec) {
    settings.options = {{"qmin", "2"}, {"qmax", "5"}, {"b", "20000000"}};
    return settings;
  }
  return make_error(ErrorCode::kUnavailable, where,
                    "this libavcodec has neither x264 nor MPEG-4 to write videos with");
}

void copy_to_frame(const I420View& from, AVFrame& frame) {
  const int half_width = (frame.width + 1) / 2, half_height = (frame.height + 1) / 2;
  copy_i420(from, {{frame.data[0], frame.width, frame.height, frame.linesize[0]},
                   {frame.data[1], half_width, half_height, frame.linesize[1]},
                   {frame.data[2], half_width, half_height, frame.linesize[2]}});
}

class LibavOverlayVideo final : public OverlayVideoWriter {
 public:
  LibavOverlayVideo(std::unique_ptr<Encoder> encoder, std::unique_ptr<VideoFile> file,
                    const OverlayVideoOptions& options, std::string where)
      : encoder_(std::move(encoder)),
        file_(std::move(file)),
        options_(options),
        where_(std::move(where)) {}
  ~LibavOverlayVideo() override { (void)close(); }

  Status append(const I420View& image, Time capture) override {
    if (image.width() != options_.width || image.height() != options_.height) {
      return make_error(ErrorCode::kInvalidInput, where_, "image is {} x {}, the video {} x {}",
                        image.width(), image.height(), options_.width, options_.height);
    }
    if (!start_) start_ = capture;
    const int64_t ms =
        std::chrono::duration_cast<std::chrono::milliseconds>(capture - *start_).count();
    last_ms_ = std::max(last_ms_ + 1, ms);
    SL_ASSIGN(AVFrame * frame, encoder_->frame());
    copy_to_frame(image, *frame);
    frame->pict_type = AV_PICTURE_TYPE_NONE;
    return encoder_->encode(last_ms_, sink());
  }

  Status close() override {
    if (!file_) return {};
    const Status flushed = encoder_->finish(sink());
    const Status closed = file_->close();
    file_.reset();
    return flushed ? closed : flushed;
  }

 private:
  Encoder::Sink sink() {
    return [this](AVPacket* packet) { return file_->write(packet); };
  }

  std::unique_ptr<Encoder> encoder_;
  std::unique_ptr<VideoFile> file_;
  const OverlayVideoOptions options_;
  const std::string where_;
  std::optional<Time> start_;
  int64_t last_ms_ = -1;
};

}  // namespace

Result<std::unique_ptr<OverlayVideoWriter>> OverlayVideoWriter::create(
    const std::filesystem::path& path, const OverlayVideoOptions& options) {
  const std::string where = path.string();
  if (options.width < 2 || options.height < 2 || options.width % 2 || options.height % 2) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "cannot write a video of {} x {} pixels: both sides must be even",
                      options.width, options.height);
  }
  SL_ASSIGN(const auto settings, choose_encoder(options, where));
  SL_ASSIGN(auto encoder, Encoder::create(settings, where));
  SL_ASSIGN(auto file, VideoFile::create(path, OutFile::Existing::kReplace, *encoder->parameters(),
                                         options.rate_hz));
  return std::unique_ptr<OverlayVideoWriter>(
      std::make_unique<LibavOverlayVideo>(std::move(encoder), std::move(file), options, where));
}

Status write_png(const std::filesystem::path& path, const I420View& image) {
  const std::string where = path.string();
  Encoder::Settings settings;
  settings.codec = avcodec_find_encoder(AV_CODEC_ID_PNG);
  settings.format = AV_PIX_FMT_RGB24;
  settings.width = image.width();
  settings.height = image.height();
  if (!settings.codec) {
    return make_error(ErrorCode::kUnavailable, where, "this libavcodec has no PNG encoder");
  }
  SL_ASSIGN(auto encoder, Encoder::create(settings, where));
  SL_ASSIGN(AVFrame * frame, encoder->frame());
  std::vector<uint8_t> rgb(3 * static_cast<size_t>(image.width()) *
                           static_cast<size_t>(image.height()));
  i420_to_rgb(image, rgb.data());
  const auto row = static_cast<ptrdiff_t>(3) * image.width();
  for (int y = 0; y < image.height(); ++y) {
    std::copy_n(rgb.data() + y * row, row, frame->data[0] + ptrdiff_t{y} * frame->linesize[0]);
  }
  std::string file;
  const Encoder::Sink sink = [&](AVPacket* packet) {
    file.append(reinterpret_cast<const char*>(packet->data), static_cast<size_t>(packet->size));
    return Status();
  };
  SL_RETURN_IF_ERROR(encoder->encode(0, sink));
  SL_RETURN_IF_ERROR(encoder->finish(sink));
  return write_file_atomically(path, file);
}

}  // namespace sightline
