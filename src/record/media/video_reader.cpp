// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/video_reader.hpp"

#include <algorithm>
#include <cstring>
#include <deque>
#include <set>
#include <vector>

#include "record/media/av.hpp"
#include "record/media/avc.hpp"
#include "record/media/to_image.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {

using namespace record;

namespace {

/// Packets a decoder may hold back; H.264 reorders 16 images at most.
constexpr size_t kMaxPending = 64;

std::shared_ptr<Image> gray_image(ImagePool& pool) {
  auto image = pool.get();
  const auto view = image->mutable_view();
  for (const auto& plane : {view.y, view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) {
      std::memset(plane.row(y), 128, static_cast<size_t>(plane.width));
    }
  }
  return image;
}

/// Decodes raw or compressed packets. Every packet gives exactly one image in the end: an image
/// that the decoder does not deliver is replaced, marked damaged, so that the n-th image always
/// belongs to the n-th row of frames.csv.
class LibavReader final : public VideoReader {
 public:
  LibavReader(std::filesystem::path file, std::string codec, int width, int height,
              const VideoReaderOptions& options)
      : file_(std::move(file)),
        codec_(std::move(codec)),
        width_(width),
        height_(height),
        options_(options),
        pool_(width, height) {}

  Status start() {
    SL_ASSIGN(auto demuxer, av::Demuxer::open(file_, codec_, width_, height_));
    demuxer_.emplace(std::move(demuxer));
    packet_.reset(av_packet_alloc());
    frame_.reset(av_frame_alloc());
    SL_CHECK(packet_ && frame_, "out of memory");
    const AVCodecParameters& parameters = demuxer_->parameters();
    reordered_ = parameters.video_delay > 0;
    if (parameters.extradata_size > 0) {
      avc_ = parse_avc_configuration(
          {parameters.extradata, static_cast<size_t>(parameters.extradata_size)});
    }
    pending_.clear();
    ready_.clear();
    last_.reset();
    decoded_ = displayed_ = 0;
    at_end_ = false;
    if (parameters.codec_id == AV_CODEC_ID_RAWVIDEO) return start_raw(parameters);
    return start_decoder(parameters);
  }

  Result<std::optional<VideoFrame>> next() override {
    while (ready_.empty() && !at_end_) {
      SL_ASSIGN(const bool more, demuxer_->read(packet_.get()));
      SL_RETURN_IF_ERROR(!more ? finish() : decoder_ ? decode() : unpack());
    }
    if (ready_.empty()) return std::optional<VideoFrame>();
    std::optional<VideoFrame> frame(std::move(ready_.front()));
    ready_.pop_front();
    return frame;
  }

  Status rewind() override { return start(); }

 private:
  /// A packet whose image has not come out yet.
  struct Pending {
    int64_t number = 0;  ///< in decoding order; travels through the decoder as its time stamp
    int64_t order = 0;   ///< grows in display order
    bool keyframe = false;
    std::shared_ptr<const AVPacket> bytes;  ///< null unless asked for
  };

  Status start_raw(const AVCodecParameters& parameters) {
    const auto format = options_.raw_format
                            ? options_.raw_format
                            : av::from_av(static_cast<AVPixelFormat>(parameters.format));
    if (!format) {
      return make_error(ErrorCode::kInvalidInput, file_.string(),
                        "raw images in a pixel format that no camera source gives");
    }
    raw_format_ = *format;
    decoder_.reset();
    return {};
  }

  Status start_decoder(const AVCodecParameters& parameters) {
    const AVCodec* codec = avcodec_find_decoder(parameters.codec_id);
    if (!codec) {
      return make_error(ErrorCode::kUnavailable, file_.string(),
                        "this libavcodec has no decoder for {}", codec_);
    }
    decoder_.reset(avcodec_alloc_context3(codec));
    SL_CHECK(decoder_ != nullptr, "out of memory");
    int code = avcodec_parameters_to_context(decoder_.get(), &parameters);
    decoder_->thread_count = 1;
    // Without it a stream that does not state its reordering depth may lose images at its start.
    if (parameters.codec_id == AV_CODEC_ID_H264) {
      decoder_->strict_std_compliance = FF_COMPLIANCE_STRICT;
    }
    if (code >= 0) code = avcodec_open2(decoder_.get(), codec, nullptr);
    if (code < 0) return av::error(file_.string(), "start the decoder", code);
    return {};
  }

  Pending make_pending() const {
    Pending pending;
    pending.number = decoded_;
    // Container time stamps serve as an order only, and only where images are reordered.
    pending.order = reordered_ ? packet_->pts : decoded_;
    pending.keyframe = (packet_->flags & AV_PKT_FLAG_KEY) != 0;
    if (options_.payload && !reordered_) {
      pending.bytes.reset(av_packet_clone(packet_.get()), [](const AVPacket* packet) {
        auto* mine = const_cast<AVPacket*>(packet);
        av_packet_free(&mine);
      });
    }
    return pending;
  }

  Status unpack() {
    Pending pending = make_pending();
    ++decoded_;
    auto image = pool_.get();
    const std::span<const uint8_t> bytes(packet_->data, static_cast<size_t>(packet_->size));
    if (raw_to_i420(raw_format_, bytes, 0, image->mutable_view())) {
      emit(pending, std::move(image), FrameStatus::kGood);
    } else {
      emit(pending, nullptr, FrameStatus::kDamaged);
    }
    return {};
  }

  Status decode() {
    pending_.push_back(make_pending());
    packet_->pts = packet_->dts = decoded_++;
    // A packet that is refused stays pending, and is replaced when a later image comes out.
    (void)avcodec_send_packet(decoder_.get(), packet_.get());
    SL_RETURN_IF_ERROR(receive_all());
    while (pending_.size() > kMaxPending) lose_before(first_pending()->order + 1);
    return {};
  }

  Status finish() {
    at_end_ = true;
    if (!decoder_) return {};
    (void)avcodec_send_packet(decoder_.get(), nullptr);
    SL_RETURN_IF_ERROR(receive_all());
    while (!pending_.empty()) lose_before(first_pending()->order + 1);
    return {};
  }

  Status receive_all() {
    for (;;) {
      const int code = avcodec_receive_frame(decoder_.get(), frame_.get());
      if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return {};
      // Damaged input: its packet stays pending. A decoder says so once per packet.
      if (code < 0) return {};
      SL_RETURN_IF_ERROR(take(*frame_));
    }
  }

  Status take(const AVFrame& frame) {
    const auto found = std::find_if(pending_.begin(), pending_.end(), [&](const Pending& pending) {
      return pending.number == frame.pts;
    });
    if (found == pending_.end()) return {};  // given up already, or a second one of its packet
    const Pending pending = std::move(*found);
    pending_.erase(found);
    if (order_is_usable()) lose_before(pending.order);
    if (frame.width != width_ || frame.height != height_) {
      emit(pending, nullptr, FrameStatus::kDamaged);
      return {};
    }
    auto image = pool_.get();
    SL_RETURN_IF_ERROR(to_image_.convert(frame, *image, file_.string()));
    const bool damaged = (frame.flags & AV_FRAME_FLAG_CORRUPT) || frame.decode_error_flags != 0;
    emit(pending, std::move(image), damaged ? FrameStatus::kDamaged : FrameStatus::kGood);
    return {};
  }

  std::vector<Pending>::iterator first_pending() {
    return std::min_element(pending_.begin(), pending_.end(), [](const auto& a, const auto& b) {
      return std::pair(a.order, a.number) < std::pair(b.order, b.number);
    });
  }

  /// False if the container's time stamps cannot tell the display order.
  bool order_is_usable() const {
    std::set<int64_t> orders;
    for (const auto& pending : pending_) {
      if (pending.order == AV_NOPTS_VALUE || !orders.insert(pending.order).second) return false;
    }
    return true;
  }

  /// Replaces all images that should have been displayed before `order`.
  void lose_before(int64_t order) {
    while (!pending_.empty()) {
      const auto first = first_pending();
      if (first->order >= order) return;
      const Pending lost = std::move(*first);
      pending_.erase(first);
      emit(lost, nullptr, FrameStatus::kDamaged);
    }
  }

  void emit(const Pending& pending, std::shared_ptr<Image> image, FrameStatus status) {
    VideoFrame out;
    out.index = displayed_++;
    out.status = status;
    if (image) last_ = std::move(image);
    if (!last_) last_ = gray_image(pool_);
    out.image = last_;
    if (pending.bytes) attach_payload(pending, out);
    ready_.push_back(std::move(out));
  }

  void attach_payload(const Pending& pending, VideoFrame& out) const {
    const std::span<const uint8_t> bytes(pending.bytes->data,
                                         static_cast<size_t>(pending.bytes->size));
    out.payload.keyframe = pending.keyframe;
    if (codec_ == "h264") {
      auto unit =
          std::make_shared<const std::vector<uint8_t>>(to_annex_b(bytes, avc_, pending.keyframe));
      out.format = PixelFormat::kH264;
      out.payload.bytes = *unit;
      out.payload.owner = std::move(unit);
    } else if (codec_ == "mjpeg" || codec_ == "rawvideo") {
      out.format = codec_ == "mjpeg" ? PixelFormat::kMjpeg : raw_format_;
      out.payload.bytes = bytes;
      out.payload.owner = pending.bytes;
    }
  }

  const std::filesystem::path file_;
  const std::string codec_;
  const int width_, height_;
  const VideoReaderOptions options_;
  ImagePool pool_;
  std::optional<av::Demuxer> demuxer_;
  av::CodecPtr decoder_;  ///< null for raw video
  av::PacketPtr packet_;
  av::AvFramePtr frame_;
  ToImage to_image_;
  AvcConfiguration avc_;
  PixelFormat raw_format_ = PixelFormat::kI420;
  bool reordered_ = false;
  bool at_end_ = false;
  int64_t decoded_ = 0;  ///< packets so far
  uint64_t displayed_ = 0;
  std::vector<Pending> pending_;
  std::deque<VideoFrame> ready_;
  std::shared_ptr<const Image> last_;
};

}  // namespace

Result<std::unique_ptr<VideoReader>> VideoReader::open(const std::filesystem::path& file,
                                                       const std::string& codec, int width,
                                                       int height,
                                                       const VideoReaderOptions& options) {
  auto reader = std::make_unique<LibavReader>(file, codec, width, height, options);
  SL_RETURN_IF_ERROR(reader->start());
  return std::unique_ptr<VideoReader>(std::move(reader));
}

Result<uint64_t> count_video_frames(const std::filesystem::path& file, const std::string& codec,
                                    int width, int height, const std::stop_token& stop) {
  SL_ASSIGN(auto demuxer, av::Demuxer::open(file, codec, width, height));
  const av::PacketPtr packet(av_packet_alloc());
  SL_CHECK(packet != nullptr, "out of memory");
  for (uint64_t count = 0;; ++count) {
    SL_ASSIGN(const bool more, demuxer.read(packet.get()));
    if (!more) return count;
    if (stop.stop_requested()) {
      return make_error(ErrorCode::kUnavailable, file.string(), "stopped while it was read");
    }
  }
}

}  // namespace sightline
