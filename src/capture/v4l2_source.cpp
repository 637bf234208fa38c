// SPDX-License-Identifier: Apache-2.0
#include "v4l2_open.hpp"

#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>

#include "bayer_decoder.hpp"
#include "frame_stamps.hpp"
#include "h264_decoder.hpp"
#include "mjpeg_decoder.hpp"
#include "sightline/base/log.hpp"
#include "v4l2_device.hpp"
#include "v4l2_ring.hpp"

namespace sightline {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kSlice = milliseconds(100);  // how soon a stop request is seen
constexpr size_t kLeastQueued = 2;              // one being filled, one to follow
constexpr int kFewestBuffers = 4, kMostBuffers = 6;
constexpr int kFirstFrameFactor = 5;
constexpr Duration kDecoding = milliseconds(50);  // longest wait for the H.264 decoder
constexpr uint64_t kInDecoder = 32;               // units whose picture may still come

Duration period_of(double rate_hz) { return rate_hz > 0 ? from_seconds(1 / rate_hz) : Duration(0); }

Duration deadline_for(const V4l2Options& options, double rate_hz) {
  if (options.frame_timeout > Duration(0)) return options.frame_timeout;
  return std::max<Duration>(seconds(1), 5 * period_of(rate_hz));
}

StampPoint point_of(uint32_t flags) {
  return (flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE
             ? StampPoint::kStartOfExposure
             : StampPoint::kEndOfFrame;
}

int64_t stamp_ns(const v4l2_buffer& filled) {
  return int64_t{filled.timestamp.tv_sec} * 1'000'000'000 +
         int64_t{filled.timestamp.tv_usec} * 1'000;
}

class V4l2Source final : public FrameSource {
 public:
  V4l2Source(const V4l2Options& options, SourceInfo info, const V4l2StreamFormat& format,
             std::optional<Duration> exposure, std::shared_ptr<V4l2Ring> ring,
             std::shared_ptr<V4l2System> system, std::unique_ptr<H264Decoder> h264)
      : info_(std::move(info)),
        format_(format),
        epoch_(options.epoch),
        deadline_(deadline_for(options, format.rate_hz)),
        counters_(options.counters ? options.counters : std::make_shared<CaptureCounters>()),
        system_(std::move(system)),
        ring_(std::move(ring)),
        pool_(std::make_shared<PicturePool>(format.width, format.height)),
        stamps_(StampPoint::kEndOfFrame, period_of(format.rate_hz), exposure),
        h264_(std::move(h264)),
        silent_after_(system_->now() + kFirstFrameFactor * deadline_) {
    if (format.format.kind == V4l2Kind::kMjpeg) mjpeg_.emplace();
    if (format.format.kind == V4l2Kind::kBayer) {
      bayer_.emplace(format.format.pattern, format.format.packing, format.width, format.height);
    }
  }
  V4l2Source(const V4l2Source&) = delete;
  V4l2Source& operator=(const V4l2Source&) = delete;
  ~V4l2Source() override { ring_->stop(); }

  const SourceInfo& info() const override { return info_; }
  Result<SourceStep> next(std::stop_token stop, Duration timeout) override;

 private:
  Result<FramePtr> take_frame(bool trouble);
  Result<FramePtr> take_h264(const v4l2_buffer& filled, Time arrival);
  Result<FramePtr> decoded_h264(Duration limit);
  Error stalled() const;
  bool is_damaged(const v4l2_buffer& filled) const;
  Result<FramePtr> frame_of(const v4l2_buffer& filled, Time arrival);
  FramePtr raw_frame(const v4l2_buffer& filled, const FrameInfo& frame);
  Result<std::shared_ptr<Picture>> decode(std::span<const uint8_t> bytes);
  FramePayload payload_of(const v4l2_buffer& filled, std::span<const uint8_t> bytes);
  FrameInfo frame_info(const v4l2_buffer& filled, Time arrival);

  const SourceInfo info_;
  const V4l2StreamFormat format_;
  const uint32_t epoch_;
  const Duration deadline_;
  const std::shared_ptr<CaptureCounters> counters_;
  const std::shared_ptr<V4l2System> system_;
  const std::shared_ptr<V4l2Ring> ring_;
  const std::shared_ptr<PicturePool> pool_;
  std::optional<MjpegDecoder> mjpeg_;
  std::optional<BayerDecoder> bayer_;
  SequenceUnwrapper sequence_;
  StampMapper stamps_;
  const std::unique_ptr<H264Decoder> h264_;
  std::vector<FrameInfo> in_decoder_{kInDecoder};  // by number of the unit
  uint64_t units_ = 0, decoded_ = 0;               // handed in, and last number that came out
  bool began_ = false;                             // with a unit that needs no other
  Time silent_after_;
  uint64_t faulty_ = 0;  // since the last buffer without the error flag
};

Result<SourceStep> V4l2Source::next(std::stop_token stop, Duration timeout) {
  const Time until = system_->now() + timeout;
  while (!stop.stop_requested()) {
    SL_RETURN_IF_ERROR(ring_->repair());
    const Time now = system_->now();
    if (now >= silent_after_) return stalled();
    const Duration limit =
        std::clamp<Duration>(std::min(until, silent_after_) - now, Duration(0), kSlice);
    if (decoded_ < units_) {  // a picture that took its time
      SL_ASSIGN(FramePtr late, decoded_h264(Duration(0)));
      if (late) return SourceStep{SourceStep::Kind::kFrame, std::move(late)};
    }
    const int events = ring_->poll(limit);
    if (events < 0) return ring_->device().error(V4l2Step::kCapture, events);
    if (events != 0) {
      SL_ASSIGN(FramePtr frame, take_frame((events & POLLERR) != 0));
      if (frame) return SourceStep{SourceStep::Kind::kFrame, std::move(frame)};
    }
    if (system_->now() >= until) break;
  }
  return SourceStep{};
}

Error V4l2Source::stalled() const {
  const std::string silence = fmt::format("for {:.1f} s", to_seconds(deadline_));
  if (ring_->queued() == 0) {
    return make_error(ErrorCode::kTimeout, info_.name,
                      "no frame {}: the driver of {} has no buffer to fill", silence,
                      ring_->device().path());
  }
  if (faulty_ > 0) {
    return make_error(
        ErrorCode::kTimeout, info_.name,
        "no whole frame from {} ({}) {}, {} damaged ones: suspect cable, hub or power",
        ring_->device().path(), ring_->device().card(), silence, faulty_);
  }
  return make_error(ErrorCode::kTimeout, info_.name,
                    "no frame from {} ({}) {}: the camera has stalled; it is opened again, if that "
                    "does not help unplug it for a moment",
                    ring_->device().path(), ring_->device().card(), silence);
}

// The next good frame; null if there is none yet, or only a damaged one. `trouble`: poll() reported
// an error, so there is a buffer, a reason, or else a driver that has stopped without one.
Result<FramePtr> V4l2Source::take_frame(bool trouble) {
  SL_ASSIGN(const auto filled, ring_->dequeue());
  if (!filled && trouble) return ring_->device().error(V4l2Step::kCapture, -EIO);
  if (!filled) return FramePtr();
  const Time arrival = system_->now();
  if (ring_->queued() == 0) counters_->starved.add();
  if ((filled->flags & V4L2_BUF_FLAG_ERROR) != 0) {
    ++faulty_;
    counters_->damaged.add();
    ring_->give_back(filled->index);
    return FramePtr();
  }
  faulty_ = 0;
  silent_after_ = arrival + deadline_;
  if (h264_) return take_h264(*filled, arrival);
  auto frame = is_damaged(*filled) ? Result<FramePtr>(FramePtr()) : frame_of(*filled, arrival);
  if (!frame || !*frame) {
    if (!frame) log::debug("{}: {}", info_.name, frame.error().text);
    counters_->damaged.add();
    ring_->give_back(filled->index);
    return FramePtr();
  }
  counters_->good.add();
  return frame;
}

// Hands the unit to the decoder and takes the picture that comes, most often of the same unit.
Result<FramePtr> V4l2Source::take_h264(const v4l2_buffer& filled, Time arrival) {
  const auto bytes = ring_->bytes(filled);
  began_ = began_ || begins_h264(bytes);
  Status pushed;
  if (began_ && !bytes.empty()) {
    ++units_;
    in_decoder_[units_ % kInDecoder] = frame_info(filled, arrival);
    pushed = h264_->push(bytes, units_);
  }
  ring_->give_back(filled.index);
  SL_RETURN_IF_ERROR(pushed);
  return began_ ? decoded_h264(kDecoding) : Result<FramePtr>(FramePtr());
}

// Units that were passed over in the decoder count as damaged, and as dropped before this frame.
Result<FramePtr> V4l2Source::decoded_h264(Duration limit) {
  auto picture = pool_->get();
  SL_ASSIGN(const auto number, h264_->pull(limit, picture->mutable_view()));
  if (!number || *number <= decoded_ || *number > units_ || units_ - *number >= kInDecoder) {
    return FramePtr();
  }
  FrameInfo frame = in_decoder_[*number % kInDecoder];
  for (uint64_t passed = decoded_ + 1; passed < *number; ++passed) {
    frame.dropped_before += 1;
    if (*number - passed < kInDecoder) {
      frame.dropped_before += in_decoder_[passed % kInDecoder].dropped_before;
    }
    counters_->damaged.add();
  }
  decoded_ = *number;
  counters_->good.add();
  frame.format = PixelFormat::kI420;
  return Frame::decoded(frame, std::move(picture), {}, pool_);
}

bool V4l2Source::is_damaged(const v4l2_buffer& filled) const {
  return filled.bytesused == 0 || ring_->bytes(filled).size() < format_.image_bytes;
}

// An error leaves the buffer with the caller.
Result<FramePtr> V4l2Source::frame_of(const v4l2_buffer& filled, Time arrival) {
  if (format_.format.kind == V4l2Kind::kRaw) {
    return raw_frame(filled, frame_info(filled, arrival));
  }
  const auto bytes = ring_->bytes(filled);
  SL_ASSIGN(std::shared_ptr<Picture> picture, decode(bytes));
  const FrameInfo frame = frame_info(filled, arrival);
  if (format_.format.kind == V4l2Kind::kMjpeg) {
    return Frame::decoded(frame, std::move(picture), payload_of(filled, trim_jpeg(bytes)), pool_);
  }
  ring_->give_back(filled.index);
  return Frame::decoded(frame, std::move(picture), {}, pool_);
}

FramePtr V4l2Source::raw_frame(const v4l2_buffer& filled, const FrameInfo& frame) {
  FramePayload payload = payload_of(filled, ring_->bytes(filled).first(format_.image_bytes));
  payload.stride = format_.stride;
  return Frame::raw(frame, std::move(payload), pool_);
}

Result<std::shared_ptr<Picture>> V4l2Source::decode(std::span<const uint8_t> bytes) {
  auto picture = pool_->get();
  const auto view = picture->mutable_view();
  SL_RETURN_IF_ERROR(mjpeg_ ? mjpeg_->decode(bytes, view)
                            : bayer_->decode(bytes, format_.stride, view));
  return picture;
}

// The driver's buffer itself, or a copy where too few would be left to fill.
FramePayload V4l2Source::payload_of(const v4l2_buffer& filled, std::span<const uint8_t> bytes) {
  FramePayload payload;
  if (ring_->queued() >= kLeastQueued) {
    payload.bytes = bytes;
    payload.dmabuf_fd = ring_->dmabuf_fd(filled.index);
    payload.owner = ring_->lend(filled.index);
    return payload;
  }
  const auto copy = ring_->copy(bytes);
  ring_->give_back(filled.index);
  counters_->copied.add();
  payload.bytes = {copy.get(), bytes.size()};
  payload.owner = copy;
  return payload;
}

FrameInfo V4l2Source::frame_info(const v4l2_buffer& filled, Time arrival) {
  const bool monotonic =
      (filled.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  stamps_.set_point(point_of(filled.flags));
  const CaptureTime time = stamps_.map(
      monotonic ? std::optional(time_from_ns(stamp_ns(filled))) : std::nullopt, arrival);
  if (monotonic && time.stamp_rejected) counters_->stamp_rejected.add();
  const auto step = sequence_.step(filled.sequence);
  counters_->lost.add(step.dropped_before);

  FrameInfo frame;
  frame.camera = info_.camera;
  frame.epoch = epoch_;
  frame.sequence = step.sequence;
  frame.dropped_before = step.dropped_before;
  frame.device_clock = monotonic ? ClockLabel::kMonotonic : ClockLabel::kNone;
  frame.device_time_ns = stamp_ns(filled);
  frame.capture = time.capture;
  frame.capture_error = time.error;
  frame.arrival = arrival;
  frame.format = format_.format.pixels;
  frame.width = format_.width;
  frame.height = format_.height;
  return frame;
}

}  // namespace

Result<std::unique_ptr<FrameSource>> open_v4l2_source_in(const V4l2Options& options,
                                                         CameraId camera, const std::string& name,
                                                         const V4l2Places& places,
                                                         std::shared_ptr<V4l2System> system) {
  SL_ASSIGN(const V4l2Node node, choose_v4l2_node(options.device, find_v4l2_nodes(places), name));
  SL_ASSIGN(V4l2Device device, V4l2Device::open(system, node.path, name));
  SL_ASSIGN(const V4l2StreamFormat format, negotiate_v4l2(device, options));
  SL_RETURN_IF_ERROR(set_v4l2_controls(device, options.controls));
  const auto exposure = v4l2_exposure(device);
  std::unique_ptr<H264Decoder> h264;
  if (format.format.kind == V4l2Kind::kH264) {
    SL_ASSIGN(h264, H264Decoder::create(format.width, format.height, name));
  }
  const int buffers = std::clamp(options.buffers, kFewestBuffers, kMostBuffers);
  SL_ASSIGN(auto ring, V4l2Ring::start(std::move(device), buffers, format.image_bytes));
  log::info("{}: {} ({}) gives {} {}x{} at {:g}/s", name, node.path, node.card, format.format.name,
            format.width, format.height, format.rate_hz);
  SourceInfo info{camera, name, format.width, format.height, format.rate_hz};
  return std::unique_ptr<FrameSource>(
      std::make_unique<V4l2Source>(options, std::move(info), format, exposure, std::move(ring),
                                   std::move(system), std::move(h264)));
}

Result<std::unique_ptr<FrameSource>> open_v4l2_source(const V4l2Options& options, CameraId camera,
                                                      const std::string& name) {
  return open_v4l2_source_in(options, camera, name, {}, real_v4l2_system());
}

}  // namespace sightline
