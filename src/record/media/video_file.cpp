// SPDX-License-Identifier: Apache-2.0
#include "record/media/video_file.hpp"

#include <algorithm>
#include <cstring>

namespace sightline::record {
namespace {

constexpr int kIoBuffer = 1 << 16;
constexpr AVRational kMilliseconds = {1, 1000};

/// libavformat 61 made the buffer const; before, the callback takes a plain pointer.
#if LIBAVFORMAT_VERSION_MAJOR < 61
template <auto Callback>
int write_shim(void* self, uint8_t* bytes, int size) {
  return Callback(self, bytes, size);
}
#else
template <auto Callback>
int write_shim(void* self, const uint8_t* bytes, int size) {
  return Callback(self, bytes, size);
}
#endif

}  // namespace

ParametersPtr make_parameters(AVCodecID codec, int width, int height,
                              std::span<const uint8_t> extradata) {
  ParametersPtr parameters(avcodec_parameters_alloc());
  SL_CHECK(parameters != nullptr, "out of memory");
  parameters->codec_type = AVMEDIA_TYPE_VIDEO;
  parameters->codec_id = codec;
  parameters->width = width;
  parameters->height = height;
  if (!extradata.empty()) {
    parameters->extradata =
        static_cast<uint8_t*>(av_mallocz(extradata.size() + AV_INPUT_BUFFER_PADDING_SIZE));
    SL_CHECK(parameters->extradata != nullptr, "out of memory");
    std::memcpy(parameters->extradata, extradata.data(), extradata.size());
    parameters->extradata_size = static_cast<int>(extradata.size());
  }
  return parameters;
}

Result<std::unique_ptr<VideoFile>> VideoFile::create(const std::filesystem::path& path,
                                                     OutFile::Existing existing,
                                                     const AVCodecParameters& parameters,
                                                     double rate_hz, Container container) {
  av::quiet();
  SL_ASSIGN(auto out, OutFile::create(path, existing));
  std::unique_ptr<VideoFile> file(new VideoFile(std::move(out)));
  SL_RETURN_IF_ERROR(file->start(parameters, rate_hz, container));
  return file;
}

Status VideoFile::start(const AVCodecParameters& parameters, double rate_hz, Container container) {
  const bool mp4 = cut_ = container == Container::kFragmentedMp4;
  packet_.reset(av_packet_alloc());
  auto* buffer = static_cast<unsigned char*>(av_malloc(kIoBuffer));
  SL_CHECK(packet_ && buffer, "out of memory");
  io_ = avio_alloc_context(buffer, kIoBuffer, 1, this, nullptr, write_shim<write_callback>,
                           mp4 ? nullptr : seek_callback);
  SL_CHECK(io_ != nullptr, "out of memory");
  int code = avformat_alloc_output_context2(&format_, nullptr, mp4 ? "mp4" : "matroska", nullptr);
  if (code < 0) return check("start the video writer", code);
  format_->pb = io_;
  format_->flags |= AVFMT_FLAG_BITEXACT;
  AVStream* stream = avformat_new_stream(format_, nullptr);
  SL_CHECK(stream != nullptr, "out of memory");
  code = avcodec_parameters_copy(stream->codecpar, &parameters);
  if (code < 0) return check("describe the video", code);
  stream->time_base = kMilliseconds;
  if (rate_hz > 0) stream->avg_frame_rate = av_d2q(rate_hz, 1000);
  AVDictionary* options = nullptr;
  // Fragments end where flush() says, and each says itself where it belongs.
  if (mp4) av_dict_set(&options, "movflags", "empty_moov+default_base_moof+frag_custom", 0);
  // Gray deeper than 8 bits and RGB have no native form in Matroska; this is how FFmpeg keeps them.
  if (!mp4) {
    av_dict_set(&options, "allow_raw_vfw", "1", 0);
    // Of each cluster: most of what it costs to write raw images, and no reader asks for it.
    av_dict_set(&options, "write_crc32", "0", 0);
  }
  large_ = parameters.codec_id == AV_CODEC_ID_RAWVIDEO;
  if (!mp4 && large_) {
    // An image a cluster, and no buffer between it and the system.
    av_dict_set(&options, "cluster_size_limit", "1024", 0);
    io_->direct = 1;
  }
  code = avformat_write_header(format_, &options);
  av_dict_free(&options);
  started_ = code >= 0;
  if (started_) avio_flush(io_);
  return check("write the head of the video", code);
}

VideoFile::~VideoFile() {
  (void)close();
  if (format_) avformat_free_context(format_);
  if (io_) {
    av_freep(&io_->buffer);
    avio_context_free(&io_);
  }
}

Status VideoFile::check(const char* tried, int code) {
  if (!written_) return written_;
  if (code >= 0 && io_->error < 0) code = io_->error;
  if (code < 0) return av::error(file_.path(), tried, code);
  return {};
}

Status VideoFile::write(std::span<const uint8_t> bytes, Duration since_start, bool keyframe) {
  const int64_t ms = std::chrono::duration_cast<std::chrono::milliseconds>(since_start).count();
  last_ms_ = std::max(last_ms_ + 1, ms);
  av_packet_unref(packet_.get());
  if (large_) file_.reserve(size_ + 2 * static_cast<int64_t>(bytes.size()));
  // Not counted, so not copied: av_write_frame() is done with the bytes when it returns.
  packet_->data = const_cast<uint8_t*>(bytes.data());
  packet_->size = static_cast<int>(bytes.size());
  packet_->pts = packet_->dts = last_ms_;
  if (keyframe) packet_->flags |= AV_PKT_FLAG_KEY;
  return write(packet_.get());
}

Status VideoFile::write(AVPacket* packet) {
  packet->stream_index = 0;
  av_packet_rescale_ts(packet, kMilliseconds, format_->streams[0]->time_base);
  return check("write an image", av_write_frame(format_, packet));
}

Status VideoFile::flush() {
  const int code = av_write_frame(format_, nullptr);
  avio_flush(io_);
  const Status flushed = check("flush the video", code);
  if (flushed) whole_ = size_;
  return flushed;
}

Status VideoFile::close() {
  if (!file_.is_open()) return {};
  int code = 0;
  if (started_ && written_) {
    code = av_write_trailer(format_);
    avio_flush(io_);
  }
  const Status finished = check("finish the video", code);
  // What a full disk took of the last fragment would be shown as damage.
  if (!finished && cut_ && whole_ > 0) (void)file_.truncate(whole_);
  const Status closed = file_.close();
  return finished ? closed : finished;
}

int VideoFile::write_callback(void* self, const uint8_t* bytes, int size) {
  auto& file = *static_cast<VideoFile*>(self);
  if (!file.written_) return AVERROR(EIO);
  file.written_ =
      file.file_.write({reinterpret_cast<const char*>(bytes), static_cast<size_t>(size)});
  if (file.written_) file.size_ += size;
  return file.written_ ? size : AVERROR(EIO);
}

int64_t VideoFile::seek_callback(void* self, int64_t offset, int whence) {
  auto& file = *static_cast<VideoFile*>(self);
  if (whence == AVSEEK_SIZE) {
    const auto size = file.file_.size();
    return size ? *size : AVERROR(EIO);
  }
  if (whence != SEEK_SET) return AVERROR(EINVAL);
  return file.file_.seek(offset) ? offset : AVERROR(EIO);
}

}  // namespace sightline::record
