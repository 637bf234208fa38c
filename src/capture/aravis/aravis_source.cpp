// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/aravis/aravis_source.hpp"

#include <algorithm>
#include <atomic>
#include <optional>

#include "capture/aravis/aravis_buffers.hpp"
#include "capture/aravis/aravis_close.hpp"
#include "capture/aravis/aravis_configure.hpp"
#include "capture/aravis/aravis_discovery.hpp"
#include "capture/aravis/aravis_latch.hpp"
#include "capture/aravis/aravis_times.hpp"
#include "capture/aravis/genicam_image.hpp"
#include "capture/common/frame_deadline.hpp"
#include "capture/common/frame_ids.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"

namespace sightline {

using namespace capture;

namespace {

using namespace std::chrono_literals;

constexpr Duration kMaxWait = 20ms;  // how soon a stop request is seen
constexpr Duration kMinDeadline = 800ms;
constexpr Duration kDeadlineWithoutRate = 3s;
constexpr int kMinFree = 2;  // buffers that readers cannot take from the stream
constexpr Duration kOldestArrival = 2s;
constexpr Duration kLatchInterval = 1s;
constexpr Duration kPtpInterval = 2s;
constexpr int kFirstLatches = 5;
// The camera is asked only right after it sent a frame: a dead one would keep us for seconds.
constexpr Duration kAlive = 20ms;

std::optional<Duration> deadline_of(const AravisOptions& options, const AravisSettings& settings) {
  const bool asked = options.frame_timeout > Duration{0};
  if (!asked && settings.triggered && settings.fire_hz <= 0) return std::nullopt;
  if (!asked && settings.rate_hz <= 0) return kDeadlineWithoutRate;
  return frame_deadline(options.frame_timeout, settings.rate_hz, kMinDeadline);
}

// Aravis stamps the first packet of a frame with the wall clock.
Time first_packet_time(ArvBuffer* buffer, Time now) {
  const auto stamp = static_cast<int64_t>(arv_buffer_get_system_timestamp(buffer));
  const Duration age(utc_now_ns() - stamp);
  // The wall clock may have been set in between.
  return stamp > 0 && age >= Duration{0} && age < kOldestArrival ? now - age : now;
}

void on_control_lost(ArvDevice*, std::atomic<bool>* lost) { lost->store(true); }

class Source final : public AravisSource {
 public:
  Source(const AravisOptions& options, const AravisSettings& settings, SourceInfo info,
         std::string device_id, uint32_t epoch, ObjectRef<ArvCamera> camera, AravisChunks chunks)
      : info_(std::move(info)),
        device_id_(std::move(device_id)),
        epoch_(epoch),
        settings_(settings),
        ptp_(options.ptp),
        deadline_(deadline_of(options, settings)),
        buffer_count_(options.buffers),
        times_(options, settings),
        ids_(settings.gige ? FrameIds::Width::k16 : FrameIds::Width::k64),
        chunk_ids_(FrameIds::Width::k64),
        chunks_(std::move(chunks)),
        camera_(std::move(camera)) {
    if (options.latch) latch_ = AravisLatch::find(camera_.get());
  }

  ~Source() override {
    if (stream_ != nullptr && !gone_) {
      ask(0, [&](GError** e) { return arv_camera_stop_acquisition(camera_.get(), e), 0; });
    }
    if (buffers_) buffers_->close();
    if (lost_handler_ != 0) {
      g_signal_handler_disconnect(arv_camera_get_device(camera_.get()), lost_handler_);
    }
    if (gone_) close_in_background(std::move(stream_), std::move(camera_));
    // Else the members go in reverse order: the stream before its camera.
  }

  Status start(const AravisOptions& options);

  const SourceInfo& info() const override { return info_; }
  Result<SourceStep> next(std::stop_token stop, Duration timeout) override;
  AravisStatus status() const override;
  Status trigger() override {
    ++counts_.triggers;
    return attempt(info_.name, "fire the software trigger",
                   [&](GError** e) { arv_camera_software_trigger(camera_.get(), e); });
  }

 private:
  Status create_stream();
  void set_stream_options(const AravisOptions& options);
  /// nullptr: the buffer is no good; it has gone back and was counted.
  FramePtr take(ArvBuffer* buffer);
  FramePtr make_frame(const FrameInfo& info, ArvBuffer* buffer, std::span<const uint8_t> bytes);
  bool image_fits(ArvBuffer* buffer, std::span<const uint8_t>& bytes);
  Error silence() const;
  FrameIds::Step number(ArvBuffer* buffer, const AravisChunks::Values& chunk);
  Status fire_when_due(Time now);
  void ask_camera(Time now);
  void read_latch();

  const SourceInfo info_;
  const std::string device_id_;
  const uint32_t epoch_;
  const AravisSettings settings_;
  const bool ptp_;
  const std::optional<Duration> deadline_;
  const int buffer_count_;
  AravisTimes times_;
  FrameIds ids_, chunk_ids_;
  const AravisChunks chunks_;
  std::optional<AravisLatch> latch_;
  std::optional<GenicamImage> image_;
  std::atomic<bool> control_lost_{false};
  bool gone_ = false;
  Time last_frame_{};
  uint64_t incomplete_before_ = 0;  ///< incomplete frames when the last good one came
  uint64_t unusable_before_ = 0;
  AravisStatus counts_;
  gulong lost_handler_ = 0;
  Time next_fire_{}, next_latch_{}, next_ptp_{};
  ObjectRef<ArvCamera> camera_;
  ObjectRef<ArvStream> stream_;
  std::shared_ptr<AravisBuffers> buffers_;
};

void Source::set_stream_options(const AravisOptions& options) {
  if (!ARV_IS_GV_STREAM(stream_.get())) return;
  const auto buffer = options.socket_buffer > 0 ? ARV_GV_STREAM_SOCKET_BUFFER_FIXED
                                                : ARV_GV_STREAM_SOCKET_BUFFER_AUTO;
  const auto resend =
      options.resend ? ARV_GV_STREAM_PACKET_RESEND_ALWAYS : ARV_GV_STREAM_PACKET_RESEND_NEVER;
  // With "auto", the size is the largest that may be taken; 0 is no limit.
  g_object_set(stream_.get(), "socket-buffer", buffer, "socket-buffer-size", options.socket_buffer,
               "packet-resend", resend, nullptr);
  if (options.resend_ratio >= 0) {
    g_object_set(stream_.get(), "packet-request-ratio", options.resend_ratio, nullptr);
  }
  if (options.packet_timeout_us > 0) {
    g_object_set(stream_.get(), "packet-timeout", options.packet_timeout_us, nullptr);
  }
  if (options.frame_retention_us > 0) {
    g_object_set(stream_.get(), "frame-retention", options.frame_retention_us, nullptr);
  }
}

Status Source::create_stream() {
  ErrorSlot slot;
  stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, slot.out()));
  if (stream_) return {};
  if (slot.is(ARV_DEVICE_ERROR_NOT_CONTROLLER)) {
    return make_error(ErrorCode::kUnavailable, info_.name,
                      "the camera is controlled by another client: stop that program");
  }
  return make_error(slot.silent() ? ErrorCode::kTimeout : ErrorCode::kIo, info_.name,
                    "cannot open the camera's stream: {}", slot.text());
}

Status Source::start(const AravisOptions& options) {
  SL_RETURN_IF_ERROR(create_stream());
  set_stream_options(options);
  lost_handler_ = g_signal_connect(arv_camera_get_device(camera_.get()), "control-lost",
                                   G_CALLBACK(on_control_lost), &control_lost_);
  buffers_ = std::make_shared<AravisBuffers>(stream_.get());
  for (int i = 0; i < buffer_count_; ++i) {
    buffers_->give_back(arv_buffer_new_allocate(settings_.payload));
  }
  for (int i = 0; i < kFirstLatches; ++i) read_latch();
  SL_RETURN_IF_ERROR(attempt(info_.name, "start the camera",
                             [&](GError** e) { arv_camera_start_acquisition(camera_.get(), e); }));
  last_frame_ = MonotonicClock::now();
  return {};
}

Result<SourceStep> Source::next(std::stop_token stop, Duration timeout) {
  const Time until = MonotonicClock::now() + timeout;
  ask_camera(until - timeout);
  for (;;) {
    const Time now = MonotonicClock::now();
    if (control_lost_.load()) {
      gone_ = true;
      return make_error(ErrorCode::kUnavailable, info_.name,
                        "control of the camera is lost: unplugged, restarted, or taken over");
    }
    if (settings_.fire_hz > 0) SL_RETURN_IF_ERROR(fire_when_due(now));
    const Time turn = settings_.fire_hz > 0 ? std::min(until, next_fire_) : until;
    const Duration wait = std::clamp<Duration>(turn - now, 0ns, kMaxWait);
    ArvBuffer* const buffer =
        wait > 0ns ? arv_stream_timeout_pop_buffer(stream_.get(), static_cast<guint64>(wait / 1us))
                   : arv_stream_try_pop_buffer(stream_.get());
    if (buffer != nullptr) {
      if (FramePtr frame = take(buffer)) return SourceStep{SourceStep::Kind::kFrame, frame};
    }
    if (deadline_ && now - last_frame_ > *deadline_) {
      gone_ = true;
      return silence();
    }
    if (stop.stop_requested() || now >= until) return SourceStep{};
  }
}

Error Source::silence() const {
  const double seconds = to_seconds(MonotonicClock::now() - last_frame_);
  const uint64_t incomplete = counts_.incomplete - incomplete_before_;
  const uint64_t unusable = counts_.unusable - unusable_before_;
  if (incomplete > 0) {
    return make_error(ErrorCode::kTimeout, info_.name,
                      "no complete frame in {:.1f} s: packets were missing in {} frames. Raise "
                      "net.core.rmem_max or packet_delay, or lower the rate or the packet size "
                      "(now {} bytes)",
                      seconds, incomplete, settings_.packet_size);
  }
  if (unusable > 0) {
    return make_error(ErrorCode::kDamaged, info_.name,
                      "no usable frame in {:.1f} s: {} were no {}x{} {} images{}", seconds,
                      unusable, settings_.width, settings_.height, settings_.format->name,
                      chunks_.active() && counts_.delivered == 0 ? " (try chunks = false)" : "");
  }
  return make_error(ErrorCode::kTimeout, info_.name,
                    "no frame in {:.1f} s: camera or cable is gone, or a firewall keeps its "
                    "packets away",
                    seconds);
}

bool Source::image_fits(ArvBuffer* buffer, std::span<const uint8_t>& bytes) {
  const ArvBufferPayloadType type = arv_buffer_get_payload_type(buffer);
  if (type != ARV_BUFFER_PAYLOAD_TYPE_IMAGE && type != ARV_BUFFER_PAYLOAD_TYPE_MULTIPART &&
      type != ARV_BUFFER_PAYLOAD_TYPE_EXTENDED_CHUNK_DATA) {
    return false;
  }
  if (static_cast<uint32_t>(arv_buffer_get_image_pixel_format(buffer)) != settings_.format->code ||
      arv_buffer_get_image_width(buffer) != settings_.width ||
      arv_buffer_get_image_height(buffer) != settings_.height) {
    return false;
  }
  int padding = 0, rows_after = 0;
  arv_buffer_get_image_padding(buffer, &padding, &rows_after);
  if (padding < 0) return false;
  if (!image_ || image_->padding() != padding) {
    image_.emplace(*settings_.format, settings_.width, settings_.height, padding);
  }
  size_t size = 0;
  const void* const data = arv_buffer_get_image_data(buffer, &size);
  bytes = {static_cast<const uint8_t*>(data), data != nullptr ? size : 0};
  return bytes.size() >= image_->bytes_needed();
}

FramePtr Source::take(ArvBuffer* buffer) {
  const Time now = MonotonicClock::now();
  std::span<const uint8_t> bytes;
  const bool complete = arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS;
  if (!complete || !image_fits(buffer, bytes)) {
    ++(complete ? counts_.unusable : counts_.incomplete);
    buffers_->give_back(buffer);
    return nullptr;
  }
  FrameInfo info;
  info.camera = info_.camera;
  info.epoch = epoch_;
  const AravisChunks::Values chunk = chunks_.read(buffer);
  const FrameIds::Step step = number(buffer, chunk);
  info.sequence = step.sequence;
  // The numbers' gap holds the frames thrown away here; a camera that does not count has only
  // these.
  const uint64_t thrown =
      counts_.incomplete + counts_.unusable - incomplete_before_ - unusable_before_;
  info.dropped_before = std::max(step.dropped_before, static_cast<uint32_t>(thrown));
  times_.stamp({static_cast<int64_t>(arv_buffer_get_timestamp(buffer)),
                first_packet_time(buffer, now), now, chunk.exposure_us},
               info);
  counts_.lost += info.dropped_before;
  ++counts_.delivered;
  incomplete_before_ = counts_.incomplete;
  unusable_before_ = counts_.unusable;
  last_frame_ = now;
  return make_frame(info, buffer, bytes);
}

FramePtr Source::make_frame(const FrameInfo& info, ArvBuffer* buffer,
                            std::span<const uint8_t> bytes) {
  if (settings_.format->direct() && buffers_->lent() < buffer_count_ - kMinFree) {
    return image_->frame(info, bytes, buffers_->lend(buffer));
  }
  if (settings_.format->direct()) ++counts_.copied;
  FramePtr frame = image_->copied_frame(info, bytes);
  buffers_->give_back(buffer);
  return frame;
}

// The camera's own number where it comes with the image: it counts what the camera dropped
// itself, too, and does not wrap at 16 bits.
FrameIds::Step Source::number(ArvBuffer* buffer, const AravisChunks::Values& chunk) {
  return chunk.frame_id ? chunk_ids_.step(*chunk.frame_id)
                        : ids_.step(arv_buffer_get_frame_id(buffer));
}

Status Source::fire_when_due(Time now) {
  if (now < next_fire_) return {};
  const Duration period = from_seconds(1 / settings_.fire_hz);
  next_fire_ = now - next_fire_ < period ? next_fire_ + period : now + period;
  const Status fired = trigger();
  if (!fired && fired.error().code == ErrorCode::kTimeout) gone_ = true;
  return fired;
}

// Asks the camera what it takes a moment to answer.
void Source::ask_camera(Time now) {
  if (gone_ || control_lost_.load() || now - last_frame_ > kAlive || counts_.delivered == 0) return;
  if (latch_ && now >= next_latch_) {
    next_latch_ = now + kLatchInterval;
    read_latch();
  }
  if (ptp_ && now >= next_ptp_) {
    next_ptp_ = now + kPtpInterval;
    counts_.ptp = ptp_state(camera_.get());
    times_.set_tai(counts_.ptp == "Slave");
    counts_.ptp_offset_ns = ptp_offset(camera_.get());
  }
}

void Source::read_latch() {
  if (!latch_) return;
  if (const auto latch = latch_->take(camera_.get())) times_.add(*latch);
}

AravisStatus Source::status() const {
  AravisStatus status = counts_;
  guint64 completed = 0, failures = 0, underruns = 0;
  arv_stream_get_statistics(stream_.get(), &completed, &failures, &underruns);
  status.underruns = underruns;
  if (ARV_IS_GV_STREAM(stream_.get())) {
    guint64 resent = 0, missing = 0;
    arv_gv_stream_get_statistics(ARV_GV_STREAM(stream_.get()), &resent, &missing);
    status.resent_packets = resent;
    status.missing_packets = missing;
    const auto info = [&](const char* name) {
      return arv_stream_get_info_uint64_by_name(stream_.get(), name);
    };
    status.aborted = info("n_timeouts");
    status.resend_requests = info("n_resend_requests");
    status.resend_refused = info("n_resend_disabled");
    status.resend_limited = info("n_resend_ratio_reached");
    status.error_packets = info("n_error_packets");
    status.duplicate_packets = info("n_duplicated_packets");
    status.ignored_packets = info("n_ignored_packets");
    status.size_errors = info("n_size_mismatch_errors");
  }
  const ClockMap& clock = times_.clock();
  status.stamps_rejected = clock.rejected();
  status.clock_resets = clock.resets();
  status.clock_drift = times_.drift();
  status.clock_bound = times_.bound();
  status.latched = times_.latched();
  status.chunks = chunks_.active();
  status.device_id = device_id_;
  status.pixel_format = settings_.format->name;
  status.packet_size = settings_.packet_size;
  return status;
}

// As the discovery has it.
std::string id_of(ArvCamera* camera) {
  const auto part = [&](const char* (*get)(ArvCamera*, GError**)) {
    return text_or_empty(ask<const char*>(nullptr, [&](GError** e) { return get(camera, e); }));
  };
  return part(arv_camera_get_vendor_name) + "-" + part(arv_camera_get_model_name) + "-" +
         part(arv_camera_get_device_serial_number);
}

Status check(const AravisOptions& options, const std::string& name) {
  if (options.buffers < 4 || options.buffers > 64) {
    return make_error(ErrorCode::kInvalidInput, name, "{} buffers: 4 to 64 make sense",
                      options.buffers);
  }
  if (options.width < 0 || options.height < 0 || (options.width == 0) != (options.height == 0)) {
    return make_error(ErrorCode::kInvalidInput, name, "no size {}x{}: give width and height, or 0",
                      options.width, options.height);
  }
  if (options.packet_size != 0 && (options.packet_size < 576 || options.packet_size > 65535)) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "no packets of {} bytes: 576 to 65535, or 0 for as large as the way allows",
                      options.packet_size);
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<AravisSource>> open_aravis_source(const AravisOptions& options,
                                                         CameraId camera, const std::string& name,
                                                         uint32_t epoch,
                                                         const std::stop_token& stop) {
  const Waiting wait("the camera");
  SL_RETURN_IF_ERROR(check(options, name));
  SL_ASSIGN(ObjectRef<ArvCamera> device, connect_aravis(options.id, name));
  AravisChunks chunks;
  const auto settings = configure_aravis(device.get(), options, name, chunks, stop);
  if (!settings) {
    if (settings.error().code == ErrorCode::kTimeout || stop.stop_requested()) {
      close_in_background(nullptr, std::move(device));
    }
    return settings.error();
  }
  const SourceInfo info{camera, name, settings->width, settings->height, settings->rate_hz};
  const std::string device_id = id_of(device.get());
  log::info("{}: {}, {} {}x{}, {:.4g} Hz{}", name, device_id, settings->format->name,
            settings->width, settings->height, settings->rate_hz,
            settings->gige ? fmt::format(", packets of {} bytes", settings->packet_size) : "");
  auto source = std::make_unique<Source>(options, *settings, info, device_id, epoch,
                                         std::move(device), std::move(chunks));
  SL_RETURN_IF_ERROR(source->start(options));
  return std::unique_ptr<AravisSource>(std::move(source));
}

std::string aravis_version() {
  return fmt::format("Aravis {}.{}.{}", arv_get_major_version(), arv_get_minor_version(),
                     arv_get_micro_version());
}

}  // namespace sightline
