// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/network/network_source.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "capture/common/frame_deadline.hpp"
#include "capture/common/gst_video.hpp"
#include "capture/decode/mjpeg_decoder.hpp"
#include "capture/network/network_pipeline.hpp"
#include "sightline/base/log.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {

using namespace capture;

namespace {

using namespace std::chrono_literals;

constexpr Duration kMaxWait = 100ms;        // how soon a stop request is seen
constexpr Duration kConnectingWait = 20ms;  // how soon a flood is, while there is no image yet
constexpr size_t kMostClosing = 3;          // connections that GStreamer does not let go of
constexpr Duration kSyncedError = 10ms;     // of two clocks that NTP keeps
constexpr Duration kUnknownError = 500ms;   // exposing, encoding and sending, before arrival
// An image whose time stamp is older, or newer than now, comes from a clock that is not ours.
constexpr Duration kOldest = 2s;
constexpr Duration kAhead = 20ms;

struct ImageCaps {
  int width = 0, height = 0;
  double rate_hz = 0;  // 0: not said
};

std::optional<ImageCaps> caps_of(GstSample* sample) {
  const GstCaps* caps = gst_sample_get_caps(sample);
  if (!caps || gst_caps_is_empty(caps)) return std::nullopt;
  const GstStructure* said = gst_caps_get_structure(caps, 0);
  ImageCaps image;
  if (!gst_structure_get_int(said, "width", &image.width) ||
      !gst_structure_get_int(said, "height", &image.height)) {
    return std::nullopt;
  }
  int up = 0, down = 1;
  if (gst_structure_get_fraction(said, "framerate", &up, &down) && up > 0 && down > 0) {
    image.rate_hz = static_cast<double>(up) / down;
  }
  if (image.rate_hz > 1000) image.rate_hz = 0;  // 90000/1 and the like say nothing
  return image;
}

class NetworkSource final : public FrameSource {
 public:
  NetworkSource(NetworkUrl url, const NetworkOptions& options, CameraId camera, std::string name,
                std::unique_ptr<NetworkPipeline> pipeline)
      : url_(std::move(url)), options_(options), pipeline_(std::move(pipeline)) {
    info_ = {camera, std::move(name), options.width, options.height, 0};
    last_frame_ = MonotonicClock::now();
  }

  ~NetworkSource() override {
    if (pipeline_->flooded()) options_.counters->floods.add();
    if (close_in_background(std::move(pipeline_), info_.name)) return;
    options_.counters->slow_closes.add();
    log::warning("{}: GStreamer does not let go of the connection to {}; it is left to itself",
                 info_.name, url_.shown);
  }

  const SourceInfo& info() const override { return info_; }

  Result<SourceStep> next(std::stop_token stop, Duration timeout) override {
    const Time give_up = MonotonicClock::now() + timeout;
    for (;;) {
      const Duration left = give_up - MonotonicClock::now();
      const Duration most = last_number_ > 0 ? kMaxWait : kConnectingWait;
      const auto taken = pipeline_->take(stop, std::clamp<Duration>(left, 0ns, most));
      pipeline_->watch_bytes();
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
    const Duration limit = last_number_ > 0
                               ? frame_deadline(options_.frame_timeout, info_.nominal_rate_hz)
                               : options_.first_frame_timeout;
    if (MonotonicClock::now() - last_frame_ <= limit) return {};
    return make_error(ErrorCode::kTimeout, info_.name, "{}: no image for {:.1f} s", url_.shown,
                      to_seconds(limit));
  }

  Status agree_on(const ImageCaps& image) {
    if ((options_.width > 0 && image.width != options_.width) ||
        (options_.height > 0 && image.height != options_.height)) {
      return make_error(ErrorCode::kInvalidInput, info_.name,
                        "{} sends {}x{} images, {}x{} are expected: set the camera to that size "
                        "or calibrate at this one",
                        url_.shown, image.width, image.height, options_.width, options_.height);
    }
    if (!pool_ || info_.width != image.width || info_.height != image.height) {
      pool_ = std::make_shared<ImagePool>(image.width, image.height);
    }
    info_.width = image.width;
    info_.height = image.height;
    info_.nominal_rate_hz = image.rate_hz;
    return {};
  }

  /// Null for an image that is damaged or cannot be read.
  Result<FramePtr> frame_of(const NetworkSample& taken) {
    GstSample* sample = taken.sample.get();
    const auto said = caps_of(sample);
    if (!said || said->width < 1 || said->height < 1 || said->width > 32768 ||
        said->height > 32768) {
      return FramePtr();
    }
    SL_RETURN_IF_ERROR(agree_on(*said));
    auto image = pool_->get();
    FramePayload payload;
    const bool jpeg = !url_.is_rtsp();
    if (!(jpeg ? decode(taken, *image, payload) : copy(sample, *image))) return FramePtr();
    FrameInfo frame = stamp(taken);
    frame.format = jpeg ? PixelFormat::kMjpeg : PixelFormat::kI420;
    last_frame_ = taken.arrival;
    last_number_ = taken.number;
    return Frame::decoded(frame, std::move(image), std::move(payload), pool_);
  }

  /// Copied, so that decoders get their few buffers back at once.
  static bool copy(GstSample* sample, Image& to) {
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
    if (fits && intact) copy_i420(i420_view(frame), to.mutable_view());
    gst_video_frame_unmap(&frame);
    return fits && intact;
  }

  /// The camera's own JPEG stays beside the image, for recording.
  bool decode(const NetworkSample& taken, Image& to, FramePayload& payload) {
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
  std::shared_ptr<ImagePool> pool_;
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
  if (const size_t closing = closing_pipelines(name); closing >= kMostClosing) {
    return make_error(ErrorCode::kUnavailable, name,
                      "GStreamer has not let go of {} earlier connections to {}; it is tried again "
                      "when it has, restart the service if it never does",
                      closing, url.shown);
  }
  SL_ASSIGN(auto pipeline, NetworkPipeline::start(url, options, name));
  NetworkOptions counted = options;
  if (!counted.counters) counted.counters = std::make_shared<NetworkCounters>();
  return std::unique_ptr<FrameSource>(
      std::make_unique<NetworkSource>(std::move(url), counted, camera, name, std::move(pipeline)));
}

}  // namespace sightline
