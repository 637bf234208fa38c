// SPDX-License-Identifier: Apache-2.0
#include "capture/common/buffered_source.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "capture/common/frame_deadline.hpp"
#include "sightline/base/log.hpp"

namespace sightline::capture {
namespace {

using std::chrono::milliseconds;

constexpr Duration kMaxWait = milliseconds(100);  // how soon a stop request is seen
constexpr size_t kMinQueued = 2;                  // one being filled, one to follow
constexpr int kFirstFrameFactor = 5;
constexpr Duration kDecoding = milliseconds(50);  // longest wait for the image of an access unit

size_t largest_buffer(const BufferDevice& device) {
  size_t largest = 0;
  for (size_t i = 0; i < device.buffer_count(); ++i) {
    largest = std::max(largest, device.memory(i).size());
  }
  return largest;
}

}  // namespace

Result<std::unique_ptr<FrameSource>> BufferedSource::start(std::shared_ptr<BufferDevice> device,
                                                           CameraId camera, const std::string& name,
                                                           const StreamLayout& layout,
                                                           FrameDecoders decoders,
                                                           const BufferedSourceOptions& options) {
  SL_RETURN_IF_ERROR(device->start());
  SourceInfo info{camera, name, layout.width, layout.height, layout.rate_hz};
  return std::unique_ptr<FrameSource>(
      new BufferedSource(std::move(device), std::move(info), layout, std::move(decoders), options));
}

BufferedSource::BufferedSource(std::shared_ptr<BufferDevice> device, SourceInfo info,
                               const StreamLayout& layout, FrameDecoders decoders,
                               const BufferedSourceOptions& options)
    : info_(std::move(info)),
      layout_(layout),
      epoch_(options.epoch),
      deadline_(frame_deadline(options.frame_timeout, layout.rate_hz)),
      counters_(options.counters ? options.counters : std::make_shared<CaptureCounters>()),
      device_(std::move(device)),
      leases_(std::make_shared<BufferLeases>(device_, options.queue_attempts)),
      images_(std::make_shared<ImagePool>(layout.width, layout.height)),
      copies_(largest_buffer(*device_)),
      decoder_(std::move(decoders.image)),
      stamps_(StampPoint::kEndOfFrame, frame_period(layout.rate_hz), std::nullopt),
      lost_at_(device_->now() + kFirstFrameFactor * deadline_) {
  if (decoders.access_unit) {
    access_units_.emplace(std::move(decoders.access_unit), images_, counters_);
  }
}

BufferedSource::~BufferedSource() { leases_->stop(); }

Result<SourceStep> BufferedSource::next(std::stop_token stop, Duration timeout) {
  const Time until = device_->now() + timeout;
  while (!stop.stop_requested()) {
    SL_RETURN_IF_ERROR(leases_->requeue_refused());
    const Time now = device_->now();
    if (now >= lost_at_) return silence();
    FramePtr frame;
    if (access_units_ && access_units_->pending()) {  // an image that took its time
      SL_ASSIGN(frame, access_units_->pull(Duration(0)));
    }
    if (!frame) {
      const Duration limit =
          std::clamp<Duration>(std::min(until, lost_at_) - now, Duration(0), kMaxWait);
      SL_ASSIGN(const auto buffer, device_->dequeue(limit));
      if (buffer) {
        SL_ASSIGN(frame, take(*buffer));
      }
    }
    if (frame) return SourceStep{SourceStep::Kind::kFrame, std::move(frame)};
    if (device_->now() >= until) break;
  }
  return SourceStep{};
}

Error BufferedSource::silence() const {
  const std::string duration = fmt::format("for {:.1f} s", to_seconds(deadline_));
  const std::string device = device_->description();
  if (leases_->queued() == 0) {
    return make_error(ErrorCode::kTimeout, info_.name, "no frame {}: {} has no buffer to fill",
                      duration, device);
  }
  if (faulty_ > 0) {
    return make_error(ErrorCode::kTimeout, info_.name,
                      "no whole frame from {} {}, {} damaged ones: suspect cable, hub or power",
                      device, duration, faulty_);
  }
  return make_error(ErrorCode::kTimeout, info_.name,
                    "no frame from {} {}: the camera has stalled; it is opened again, if that does "
                    "not help unplug it for a moment",
                    device, duration);
}

// Null: no good frame (yet); the buffer has gone back and was counted.
Result<FramePtr> BufferedSource::take(const FilledBuffer& buffer) {
  SL_RETURN_IF_ERROR(leases_->take(buffer.index, info_.name));
  if (leases_->queued() == 0) counters_->starved.add();
  if (buffer.damaged) {
    ++faulty_;
    counters_->damaged.add();
    leases_->give_back(buffer.index);
    return FramePtr();
  }
  // Data that cannot be decoded keeps a camera alive: garbage from a cable passes by itself, while
  // an endpoint that only fails needs a fresh start.
  faulty_ = 0;
  lost_at_ = buffer.arrival + deadline_;
  if (access_units_) return take_access_unit(buffer);
  const bool whole = buffer.bytes_used > 0 && bytes_of(buffer).size() >= layout_.image_bytes;
  auto frame = whole ? frame_of(buffer) : Result<FramePtr>(FramePtr());
  if (!frame || !*frame) {
    if (!frame) log::debug("{}: {}", info_.name, frame.error().text);
    counters_->damaged.add();
    leases_->give_back(buffer.index);
    return FramePtr();
  }
  counters_->good.add();
  return frame;
}

// Hands the unit to the decoder and takes the image that comes, most often of the same unit: one
// that is waited for builds up no delay.
Result<FramePtr> BufferedSource::take_access_unit(const FilledBuffer& buffer) {
  const auto bytes = bytes_of(buffer);
  const bool accepted = access_units_->accepts(bytes);
  Status pushed;
  if (accepted && !bytes.empty()) pushed = access_units_->push(bytes, stamped(buffer));
  leases_->give_back(buffer.index);
  SL_RETURN_IF_ERROR(pushed);
  return accepted ? access_units_->pull(kDecoding) : Result<FramePtr>(FramePtr());
}

// An error leaves the buffer with the caller.
Result<FramePtr> BufferedSource::frame_of(const FilledBuffer& buffer) {
  const auto bytes = bytes_of(buffer);
  if (!decoder_) {
    const FrameInfo frame = stamped(buffer);
    FramePayload payload = payload_of(buffer, bytes.first(layout_.image_bytes));
    payload.stride = layout_.stride;
    return Frame::raw(frame, std::move(payload), images_);
  }
  auto image = images_->get();
  SL_RETURN_IF_ERROR(decoder_->decode(bytes, image->mutable_view()));
  const FrameInfo frame = stamped(buffer);
  FramePayload payload;
  if (const auto kept = decoder_->payload(bytes); !kept.empty()) {
    payload = payload_of(buffer, kept);
  } else {
    leases_->give_back(buffer.index);
  }
  return Frame::decoded(frame, std::move(image), std::move(payload), images_);
}

std::span<const uint8_t> BufferedSource::bytes_of(const FilledBuffer& buffer) const {
  const auto memory = device_->memory(buffer.index);
  return memory.first(std::min(buffer.bytes_used, memory.size()));
}

// The camera's buffer itself, or a copy where too few would be left to fill.
FramePayload BufferedSource::payload_of(const FilledBuffer& buffer,
                                        std::span<const uint8_t> bytes) {
  FramePayload payload;
  if (leases_->queued() >= kMinQueued) {
    payload.bytes = bytes;
    payload.dmabuf_fd = device_->dmabuf_fd(buffer.index);
    payload.owner = leases_->lend(buffer.index);
    return payload;
  }
  const auto copy = copies_.get();
  std::copy(bytes.begin(), bytes.end(), copy.get());
  leases_->give_back(buffer.index);
  counters_->copied.add();
  payload.bytes = {copy.get(), bytes.size()};
  payload.owner = copy;
  return payload;
}

FrameInfo BufferedSource::stamped(const FilledBuffer& buffer) {
  stamps_.set_point(buffer.stamp_point);
  stamps_.set_exposure(buffer.exposure);
  const CaptureTime time = stamps_.map(buffer.stamp, buffer.arrival);
  if (buffer.stamp && time.stamp_rejected) counters_->stamp_rejected.add();
  const auto step = ids_.step(buffer.sequence);
  counters_->lost.add(step.dropped_before);

  FrameInfo frame;
  frame.camera = info_.camera;
  frame.epoch = epoch_;
  frame.sequence = step.sequence;
  frame.dropped_before = step.dropped_before;
  frame.device_clock = buffer.stamp ? ClockLabel::kMonotonic : ClockLabel::kNone;
  frame.device_time_ns = buffer.device_time_ns;
  frame.capture = time.capture;
  frame.capture_error = time.error;
  frame.arrival = buffer.arrival;
  frame.format = layout_.pixels;
  frame.width = layout_.width;
  frame.height = layout_.height;
  return frame;
}

}  // namespace sightline::capture
