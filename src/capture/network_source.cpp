// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/network_source.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "mjpeg_decoder.hpp"
#include "network_pipeline.hpp"
#include "sightline/base/log.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr Duration kTurn = 100ms;
constexpr Duration kShortestTimeout = 1s;
constexpr int kPeriods = 5;
constexpr Duration kSyncedError = 10ms;    // of two clocks that NTP keeps
constexpr Duration kUnknownError = 500ms;  // exposing, encoding and sending, before arrival
// A picture whose time stamp is older, or newer than now, comes from a clock that is not ours.
constexpr Duration kOldest = 2s;
constexpr Duration kAhead = 20ms;

struct Shape {
  int width = 0, height = 0;
  double rate_hz = 0;  // 0: not said
};

std::optional<Shape> shape_of(GstSample* sample) {
  const GstCaps* caps = gst_sample_get_caps(sample);
  if (!caps || gst_caps_is_empty(caps)) return std::nullopt;
  const GstStructure* said = gst_caps_get_structure(caps, 0);
  Shape shape;
  if (!gst_structure_get_int(said, "width", &shape.width) ||
      !gst_structure_get_int(said, "height", &shape.height)) {
    return std::nullopt;
  }
  int up = 0, down = 1;
  if (gst_structure_get_fraction(said, "framerate", &up, &down) && up > 0 && down > 0) {
    shape.rate_hz = static_cast<double>(up) / down;
  }
  if (shape.rate_hz > 1000) shape.rate_hz = 0;  // 90000/1 and the like say nothing
  return shape;
}

I420View view_of(const GstVideoFrame& frame) {
  const auto plane = [&](guint i) {
    return PlaneView{static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i)),
                     GST_VIDEO_FRAME_COMP_WIDTH(&frame, i), GST_VIDEO_FRAME_COMP_HEIGHT(&frame, i),
                     GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i)};
  };
  return {plane(0), plane(1), plane(2)};
}

class NetworkSource final : public FrameSource {
 public:
  NetworkSource(NetworkUrl url, const NetworkOptions& options, CameraId camera, std::string name,
                std::unique_ptr<NetworkPipeline> pipeline)
      : url_(std::move(url)), options_(options), pipeline_(std::move(pipeline)) {
    info_ = {camera, std::move(name), options.width, options.height, 0};
    last_frame_ = MonotonicClock::now();
  }

  const SourceInfo& info() const override { return info_; }

  Result<SourceStep> next(std::stop_token stop, Duration timeout) override {
    const Time give_up = MonotonicClock::now() + timeout;
    for (;;) {
      const Duration left = give_up - MonotonicClock::now();
      const auto taken = pipeline_->take(stop, std::clamp<Duration>(left, 0ns, kTurn));
      if (taken) {
        SL_ASSIGN(FramePtr frame, frame_of(*taken));
        if (frame) return SourceStep{SourceStep::Kind::kFrame, std::move(frame)};
        continue;
      }
      if (auto failure = pipeline_->failure()) return Error(*std::move(failure));
      SL_RETURN_IF_ERROR(check_deadline());
      if (stop.stop_requested() || MonotonicClock::now() >= give_up) return SourceStep{};
    }
  }

 private:
  Status check_deadline() const {
    Duration limit = options_.first_frame_timeout;
    if (last_number_ > 0) {
      limit = options_.frame_timeout;
      if (limit <= 0ns) {
        limit = kShortestTimeout;
        if (info_.nominal_rate_hz > 0) {
          limit = std::max(limit, from_seconds(kPeriods / info_.nominal_rate_hz));
        }
      }
    }
    if (MonotonicClock::now() - last_frame_ <= limit) return {};
    return make_error(ErrorCode::kTimeout, info_.name, "{}: no picture for {:.1f} s", url_.shown,
                      to_seconds(limit));
  }

  Status agree_on(const Shape& shape) {
    if ((options_.width > 0 && shape.width != options_.width) ||
        (options_.height > 0 && shape.height != options_.height)) {
      return make_error(ErrorCode::kInvalidInput, info_.name,
                        "{} sends {}x{} pictures, {}x{} are expected: set the camera to that size "
                        "or calibrate at this one",
                        url_.shown, shape.width, shape.height, options_.width, options_.height);
    }
    if (!pool_ || info_.width != shape.width || info_.height != shape.height) {
      pool_ = std::make_shared<PicturePool>(shape.width, shape.height);
    }
    info_.width = shape.width;
    info_.height = shape.height;
    info_.nominal_rate_hz = shape.rate_hz;
    return {};
  }

  /// Null for a picture that is damaged or cannot be read.
  Result<FramePtr> frame_of(const NetworkSample& taken) {
    GstSample* sample = taken.sample.get();
    const auto shape = shape_of(sample);
    if (!shape || shape->width < 1 || shape->height < 1 || shape->width > 32768 ||
        shape->height > 32768) {
      return FramePtr();
    }
    SL_RETURN_IF_ERROR(agree_on(*shape));
    auto picture = pool_->get();
    FramePayload payload;
    const bool jpeg = !url_.is_rtsp();
    if (!(jpeg ? decode(taken, *picture, payload) : copy(sample, *picture))) return FramePtr();
    FrameInfo frame = stamp(taken);
    frame.format = jpeg ? PixelFormat::kMjpeg : PixelFormat::kI420;
    last_frame_ = taken.arrival;
    last_number_ = taken.number;
    return Frame::decoded(frame, std::move(picture), std::move(payload), pool_);
  }

  /// Copied, so that decoders get their few buffers back at once.
  static bool copy(GstSample* sample, Picture& to) {
    GstVideoInfo video;
    GstVideoFrame frame;
    GstBuffer* buffer = gst_sample_get_buffer(sample);
    if (!gst_video_info_from_caps(&video, gst_sample_get_caps(sample)) ||
        !gst_video_frame_map(&frame, &video, buffer, GST_MAP_READ)) {
      return false;
    }
    const bool fits = GST_VIDEO_FRAME_FORMAT(&frame) == GST_VIDEO_FORMAT_I420 &&
                      GST_VIDEO_FRAME_WIDTH(&frame) == to.width() &&
                      GST_VIDEO_FRAME_HEIGHT(&frame) == to.height();
    const bool intact = !GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_CORRUPTED);
    if (fits && intact) copy_i420(view_of(frame), to.mutable_view());
    gst_video_frame_unmap(&frame);
    return fits && intact;
  }

  /// The camera's own JPEG stays beside the picture, for recording.
  bool decode(const NetworkSample& taken, Picture& to, FramePayload& payload) {
    struct Held {
      std::shared_ptr<GstSample> sample;
      MappedBuffer bytes;
      explicit Held(const std::shared_ptr<GstSample>& from)
          : sample(from), bytes(gst_sample_get_buffer(from.get())) {}
    };
    const auto held = std::make_shared<const Held>(taken.sample);
    payload.bytes = trim_jpeg({held->bytes.data(), held->bytes.size()});
    payload.owner = held;
    return decoder_.decode(payload.bytes, to.mutable_view()).has_value();
  }

  FrameInfo stamp(const NetworkSample& taken) {
    FrameInfo frame;
    frame.camera = info_.camera;
    frame.epoch = options_.epoch;
    frame.sequence = taken.number;
    frame.dropped_before = static_cast<uint32_t>(
        std::min<uint64_t>(taken.number - last_number_ - 1, std::numeric_limits<uint32_t>::max()));
    frame.width = info_.width;
    frame.height = info_.height;
    frame.arrival = taken.arrival;
    const auto packet = pipeline_->packet_arrival(taken.sample.get());
    const bool stamped = packet && *packet <= taken.arrival && *packet > taken.arrival - kOldest;
    frame.capture = stamped ? *packet : taken.arrival;
    frame.capture_error = kUnknownError;
    if (const auto utc = pipeline_->sender_utc_ns(taken.sample.get())) use_sender(*utc, frame);
    return frame;
  }

  void use_sender(int64_t utc, FrameInfo& frame) {
    const Duration age(utc_ns_of(frame.arrival) - utc);
    if (age < -kAhead || age > kOldest) {
      if (!disagreement_said_) {
        log::warning("{}: the camera's clock is {:.1f} s from this host's; its times are not used",
                     info_.name, -to_seconds(age));
      }
      disagreement_said_ = true;
      return;
    }
    frame.device_clock = ClockLabel::kRealtime;
    frame.device_time_ns = utc;
    frame.capture = std::min(frame.arrival - age, frame.arrival);
    frame.capture_error = kSyncedError;
  }

  const NetworkUrl url_;
  const NetworkOptions options_;
  SourceInfo info_;
  std::shared_ptr<PicturePool> pool_;
  MjpegDecoder decoder_;
  Time last_frame_;
  uint64_t last_number_ = 0;
  bool disagreement_said_ = false;
  std::unique_ptr<NetworkPipeline> pipeline_;
};

}  // namespace

Result<std::unique_ptr<FrameSource>> open_network_source(const NetworkOptions& options,
                                                         CameraId camera, const std::string& name) {
  SL_ASSIGN(NetworkUrl url, parse_network_url(options.url, name));
  SL_ASSIGN(auto pipeline, NetworkPipeline::start(url, options, name));
  return std::unique_ptr<FrameSource>(
      std::make_unique<NetworkSource>(std::move(url), options, camera, name, std::move(pipeline)));
}

}  // namespace sightline
