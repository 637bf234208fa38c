// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/libcamera_source.hpp"

#include <algorithm>
#include <chrono>

#include "bayer_decoder.hpp"
#include "bytes_pool.hpp"
#include "frame_stamps.hpp"
#include "libcamera_camera.hpp"
#include "libcamera_loans.hpp"
#include "mjpeg_decoder.hpp"

namespace sightline {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kSlice = milliseconds(100);  // how soon a stop request is seen
constexpr size_t kLeastQueued = 2;              // one being filled, one to follow
constexpr int kFirstFrameFactor = 5;
// Clocks further apart than this are told apart by the stamp; closer, it does not matter which.
constexpr Duration kSameClock = std::chrono::microseconds(100);

Duration period_of(double rate_hz) { return rate_hz > 0 ? from_seconds(1 / rate_hz) : Duration(0); }

Duration deadline_for(const LibcameraOptions& options, double rate_hz) {
  if (options.frame_timeout > Duration(0)) return options.frame_timeout;
  return std::max<Duration>(seconds(1), 5 * period_of(rate_hz));
}

class LibcameraSource final : public FrameSource {
 public:
  LibcameraSource(std::shared_ptr<LibcameraCamera> device, const LibcameraOptions& options,
                  SourceInfo info)
      : info_(std::move(info)),
        stream_(device->stream()),
        epoch_(options.epoch),
        deadline_(deadline_for(options, stream_.rate_hz)),
        counters_(options.counters ? options.counters : std::make_shared<CaptureCounters>()),
        device_(std::move(device)),
        loans_(std::make_shared<LibcameraLoans>(device_)),
        pool_(std::make_shared<PicturePool>(stream_.width, stream_.height)),
        copies_(device_->memory(0).size()),
        stamps_(StampPoint::kStartOfExposure, period_of(stream_.rate_hz), std::nullopt),
        silent_after_(device_->now() + kFirstFrameFactor * deadline_) {
    const V4l2Format& format = *stream_.format;
    if (format.kind == V4l2Kind::kMjpeg) mjpeg_.emplace();
    if (format.kind == V4l2Kind::kBayer) {
      bayer_.emplace(format.pattern, format.packing, stream_.width, stream_.height);
    }
  }
  LibcameraSource(const LibcameraSource&) = delete;
  LibcameraSource& operator=(const LibcameraSource&) = delete;
  ~LibcameraSource() override { loans_->close(); }

  const SourceInfo& info() const override { return info_; }
  Result<SourceStep> next(std::stop_token stop, Duration timeout) override;

 private:
  Error stalled() const;
  FramePtr take_frame(const LibcameraShot& shot);
  Result<FramePtr> frame_of(const LibcameraShot& shot, Time arrival);
  Result<std::shared_ptr<Picture>> decode(std::span<const uint8_t> bytes);
  FramePayload payload_of(size_t slot, std::span<const uint8_t> bytes);
  FrameInfo frame_info(const LibcameraShot& shot, Time arrival);
  std::optional<Time> monotonic(int64_t sensor_ns, Time arrival) const;

  const SourceInfo info_;
  const LibcameraStream stream_;
  const uint32_t epoch_;
  const Duration deadline_;
  const std::shared_ptr<CaptureCounters> counters_;
  const std::shared_ptr<LibcameraCamera> device_;
  const std::shared_ptr<LibcameraLoans> loans_;
  const std::shared_ptr<PicturePool> pool_;
  BytesPool copies_;
  std::optional<MjpegDecoder> mjpeg_;
  std::optional<BayerDecoder> bayer_;
  SequenceUnwrapper sequence_;
  StampMapper stamps_;
  Time silent_after_;
  uint64_t faulty_ = 0;  // since the last buffer without an error
};

Result<SourceStep> LibcameraSource::next(std::stop_token stop, Duration timeout) {
  const Time until = device_->now() + timeout;
  while (!stop.stop_requested()) {
    SL_RETURN_IF_ERROR(loans_->refusal());
    const Time now = device_->now();
    if (now >= silent_after_) return stalled();
    const Duration limit =
        std::clamp<Duration>(std::min(until, silent_after_) - now, Duration(0), kSlice);
    SL_ASSIGN(const auto shot, device_->wait(limit));
    if (shot) {
      if (FramePtr frame = take_frame(*shot)) {
        return SourceStep{SourceStep::Kind::kFrame, std::move(frame)};
      }
    }
    if (device_->now() >= until) break;
  }
  return SourceStep{};
}

Error LibcameraSource::stalled() const {
  const std::string silence = fmt::format("for {:.1f} s", to_seconds(deadline_));
  if (loans_->queued() == 0) {
    return make_error(ErrorCode::kTimeout, info_.name, "no frame {}: {} has no buffer to fill",
                      silence, device_->id());
  }
  if (faulty_ > 0) {
    return make_error(ErrorCode::kTimeout, info_.name,
                      "no whole frame from {} {}, {} damaged ones: suspect cable, hub or power",
                      device_->id(), silence, faulty_);
  }
  return make_error(ErrorCode::kTimeout, info_.name,
                    "no frame from {} {}: the camera has stalled; it is opened again, if that does "
                    "not help unplug it for a moment",
                    device_->id(), silence);
}

// Null: the buffer was damaged; it has gone back and was counted.
FramePtr LibcameraSource::take_frame(const LibcameraShot& shot) {
  const Time arrival = device_->now();
  loans_->taken(shot.slot);
  if (loans_->queued() == 0) counters_->starved.add();
  if (!shot.good) {
    ++faulty_;
    counters_->damaged.add();
    loans_->give_back(shot.slot);
    return nullptr;
  }
  faulty_ = 0;
  silent_after_ = arrival + deadline_;
  const bool whole = shot.bytes > 0 && shot.bytes >= stream_.image_bytes;
  const auto frame = whole ? frame_of(shot, arrival) : Result<FramePtr>(FramePtr());
  if (!frame || !*frame) {
    counters_->damaged.add();
    loans_->give_back(shot.slot);
    return nullptr;
  }
  counters_->good.add();
  return *frame;
}

// An error leaves the buffer with the caller.
Result<FramePtr> LibcameraSource::frame_of(const LibcameraShot& shot, Time arrival) {
  const auto bytes = device_->memory(shot.slot).first(shot.bytes);
  if (stream_.format->kind == V4l2Kind::kRaw) {
    const FrameInfo frame = frame_info(shot, arrival);
    FramePayload payload = payload_of(shot.slot, bytes.first(stream_.image_bytes));
    payload.stride = stream_.stride;
    return Frame::raw(frame, std::move(payload), pool_);
  }
  SL_ASSIGN(std::shared_ptr<Picture> picture, decode(bytes));
  const FrameInfo frame = frame_info(shot, arrival);
  if (mjpeg_) {
    return Frame::decoded(frame, std::move(picture), payload_of(shot.slot, trim_jpeg(bytes)),
                          pool_);
  }
  loans_->give_back(shot.slot);
  return Frame::decoded(frame, std::move(picture), {}, pool_);
}

Result<std::shared_ptr<Picture>> LibcameraSource::decode(std::span<const uint8_t> bytes) {
  auto picture = pool_->get();
  const auto view = picture->mutable_view();
  SL_RETURN_IF_ERROR(mjpeg_ ? mjpeg_->decode(bytes, view)
                            : bayer_->decode(bytes, stream_.stride, view));
  return picture;
}

// The camera's buffer itself, or a copy where too few would be left to fill.
FramePayload LibcameraSource::payload_of(size_t slot, std::span<const uint8_t> bytes) {
  FramePayload payload;
  if (loans_->queued() >= kLeastQueued) {
    payload.bytes = bytes;
    payload.dmabuf_fd = device_->dmabuf_fd(slot);
    payload.owner = loans_->lend(slot);
    return payload;
  }
  const auto copy = copies_.get();
  std::copy(bytes.begin(), bytes.end(), copy.get());
  loans_->give_back(slot);
  counters_->copied.add();
  payload.bytes = {copy.get(), bytes.size()};
  payload.owner = copy;
  return payload;
}

// The clock that the stamp is nearer to, as long as the two differ.
std::optional<Time> LibcameraSource::monotonic(int64_t sensor_ns, Time arrival) const {
  if (sensor_ns <= 0) return std::nullopt;
  const Duration asleep = device_->time_asleep();
  const Time stamp = time_from_ns(sensor_ns);
  if (asleep < kSameClock) return stamp;
  const auto distance = [arrival](Time t) { return t > arrival ? t - arrival : arrival - t; };
  return distance(stamp - asleep) < distance(stamp) ? stamp - asleep : stamp;
}

FrameInfo LibcameraSource::frame_info(const LibcameraShot& shot, Time arrival) {
  stamps_.set_exposure(shot.exposure_ns > 0 ? std::optional(Duration(shot.exposure_ns))
                                            : std::nullopt);
  const auto stamp = monotonic(shot.sensor_ns, arrival);
  const CaptureTime time = stamps_.map(stamp, arrival);
  if (stamp && time.stamp_rejected) counters_->stamp_rejected.add();
  const auto step = sequence_.step(shot.sequence);
  counters_->lost.add(step.dropped_before);

  FrameInfo frame;
  frame.camera = info_.camera;
  frame.epoch = epoch_;
  frame.sequence = step.sequence;
  frame.dropped_before = step.dropped_before;
  frame.device_clock = stamp ? ClockLabel::kMonotonic : ClockLabel::kNone;
  frame.device_time_ns = shot.sensor_ns;
  frame.capture = time.capture;
  frame.capture_error = time.error;
  frame.arrival = arrival;
  frame.format = stream_.format->pixels;
  frame.width = stream_.width;
  frame.height = stream_.height;
  return frame;
}

}  // namespace

Result<std::unique_ptr<FrameSource>> open_libcamera_source_on(
    std::shared_ptr<LibcameraCamera> device, const LibcameraOptions& options, CameraId camera,
    const std::string& name) {
  SL_RETURN_IF_ERROR(device->start());
  const LibcameraStream& stream = device->stream();
  SourceInfo info{camera, name, stream.width, stream.height, stream.rate_hz};
  return std::unique_ptr<FrameSource>(
      std::make_unique<LibcameraSource>(std::move(device), options, std::move(info)));
}

const V4l2Format* find_libcamera_format(std::string_view name) {
  // DRM names colours from the high byte of a little-endian word down, V4L2 in the order of memory.
  if (name == "RGB888") return find_v4l2_format(std::string_view("BGR24"));
  if (name == "BGR888") return find_v4l2_format(std::string_view("RGB24"));
  if (name == "R8") return find_v4l2_format(std::string_view("GREY"));
  if (name == "R10" || name == "R12" || name == "R16") {
    return find_v4l2_format(fmt::format("Y{}", name.substr(1)));
  }
  constexpr std::string_view kPacked = "_CSI2P";
  if (name.ends_with(kPacked)) {
    return find_v4l2_format(fmt::format("{}P", name.substr(0, name.size() - kPacked.size())));
  }
  return find_v4l2_format(name);
}

}  // namespace sightline
