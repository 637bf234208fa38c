// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/source_factory.hpp"

#include <utility>

#include "sightline/pipeline/metered_source.hpp"

namespace sightline {
namespace {

// V4L2 and libcamera count alike, by counters of the source's life.
template <typename Options, typename Open>
SourceFactory::Opener counted_opener(const Options& chosen, const std::string& name, CameraId id,
                                     Registry& registry, Open open) {
  return [options = chosen, name, id, &registry,
          open](const std::stop_token& stop) mutable -> Result<std::unique_ptr<FrameSource>> {
    const auto counters = std::make_shared<CaptureCounters>();
    options.counters = counters;
    SL_ASSIGN(auto source, open(options, id, name, stop));
    ++options.epoch;
    const auto read = [counters] {
      return MeteredSource::Causes{{"lost", counters->lost.value()},
                                   {"damaged", counters->damaged.value()},
                                   {"copied", counters->copied.value()},
                                   {"no_buffer", counters->starved.value()},
                                   {"stamp_rejected", counters->stamp_rejected.value()}};
    };
    return std::unique_ptr<FrameSource>(
        std::make_unique<MeteredSource>(std::move(source), name, registry, read));
  };
}

// Frames of a camera whose stamps are early by so much.
class TimeOffsetSource final : public FrameSource {
 public:
  TimeOffsetSource(std::unique_ptr<FrameSource> source, Duration offset)
      : source_(std::move(source)), offset_(offset) {}
  const SourceInfo& info() const override { return source_->info(); }
  Result<SourceStep> next(std::stop_token stop, Duration timeout) override {
    SL_ASSIGN(SourceStep step, source_->next(std::move(stop), timeout));
    if (step.frame) step.frame = Frame::with_time_offset(step.frame, offset_);
    return step;
  }

 private:
  std::unique_ptr<FrameSource> source_;
  const Duration offset_;
};

// Frames of a camera that turns, by what is known of its angles when each arrives.
class TurningSource final : public FrameSource {
 public:
  TurningSource(std::unique_ptr<FrameSource> source, std::shared_ptr<const AxisHistory> axes)
      : source_(std::move(source)), axes_(std::move(axes)) {}
  const SourceInfo& info() const override { return source_->info(); }
  Result<SourceStep> next(std::stop_token stop, Duration timeout) override {
    SL_ASSIGN(SourceStep step, source_->next(std::move(stop), timeout));
    if (step.frame) {
      step.frame = Frame::with_place(step.frame, axes_->place_at(step.frame->info().capture));
    }
    return step;
  }

 private:
  std::unique_ptr<FrameSource> source_;
  const std::shared_ptr<const AxisHistory> axes_;
};

bool is_mjpeg(const std::string& format) { return format == "MJPEG" || format == "MJPG"; }

// How well a camera's clock is known.
struct ClockGauges {
  Gauge *drift, *bound, *ptp_slave, *ptp_offset;
};

ClockGauges clock_gauges(Registry& registry, const std::string& camera) {
  const Labels labels{{"camera", camera}};
  return {
      &registry.gauge("sightline_clock_drift_ratio",
                      "Rate of the camera's clock against the host's, minus 1", labels),
      &registry.gauge("sightline_clock_bound_seconds",
                      "Bound on the mapping of the camera's clock to the host's", labels),
      &registry.gauge("sightline_ptp_slave",
                      "1 while the camera's clock follows a PTP master, else 0", labels),
      &registry.gauge("sightline_ptp_offset_seconds",
                      "Of the camera's clock from the PTP master's, as the camera says", labels)};
}

}  // namespace

SourceFactory::Opener SourceFactory::opener(const CameraConfig& camera, CameraId id, bool payload,
                                            std::shared_ptr<const AxisHistory> axes) {
  Opener open = timed_opener(camera, id, payload);
  if (!axes || camera.source == SourceKind::kReplay) return open;
  return [open = std::move(open),
          axes](const std::stop_token& stop) -> Result<std::unique_ptr<FrameSource>> {
    SL_ASSIGN(auto source, open(stop));
    return std::unique_ptr<FrameSource>(std::make_unique<TurningSource>(std::move(source), axes));
  };
}

SourceFactory::Opener SourceFactory::timed_opener(const CameraConfig& camera, CameraId id,
                                                  bool payload) {
  Opener open = bare_opener(camera, id, payload);
  const Duration offset = from_seconds(camera.calibration.time_offset_s);
  if (offset == Duration(0)) return open;
  return [open = std::move(open),
          offset](const std::stop_token& stop) -> Result<std::unique_ptr<FrameSource>> {
    SL_ASSIGN(auto source, open(stop));
    return std::unique_ptr<FrameSource>(
        std::make_unique<TimeOffsetSource>(std::move(source), offset));
  };
}

SourceFactory::Opener SourceFactory::bare_opener(const CameraConfig& camera, CameraId id,
                                                 bool payload) {
  switch (camera.source) {
    case SourceKind::kNetwork:
      return network_opener(camera, id);
    case SourceKind::kAravis:
      return aravis_opener(camera, id);
    case SourceKind::kV4l2:
      return counted_opener(camera.v4l2, camera.name, id, registry_, open_v4l2_source);
    case SourceKind::kLibcamera:
      return counted_opener(camera.libcamera, camera.name, id, registry_, open_libcamera_source);
    case SourceKind::kReplay:
      break;
  }
  return [this, camera, id, payload](const std::stop_token& stop) {
    return replays_.open(camera, id, payload, stop);
  };
}

SourceFactory::Opener SourceFactory::network_opener(const CameraConfig& camera, CameraId id) {
  // What a source came to is known after its own last call: told at the next opening.
  struct Told {
    Counter& told;
    uint64_t before = 0;
    void up_to(uint64_t now) { told.add(now - std::exchange(before, now)); }
  };
  const auto told = [this, &camera](const char* cause) {
    return Told{registry_.counter(MeteredSource::kEvents, MeteredSource::kEventsHelp,
                                  {{"camera", camera.name}, {"cause", cause}})};
  };
  NetworkOptions counted = camera.network;
  counted.counters = std::make_shared<NetworkCounters>();
  return [options = std::move(counted), name = camera.name, id, slow_closes = told("slow_close"),
          floods = told("flood")](const std::stop_token&) mutable {
    slow_closes.up_to(options.counters->slow_closes.value());
    floods.up_to(options.counters->floods.value());
    auto source = open_network_source(options, id, name);
    ++options.epoch;
    return source;
  };
}

SourceFactory::Opener SourceFactory::aravis_opener(const CameraConfig& camera, CameraId id) {
  return [options = camera.aravis, name = camera.name, id, epoch = uint32_t{0},
          identity = std::string(), &registry = registry_](
             const std::stop_token& stop) mutable -> Result<std::unique_ptr<FrameSource>> {
    SL_ASSIGN(auto source, open_aravis_source(options, id, name, epoch, stop));
    const std::string found = source->status().device_id;
    if (!identity.empty() && found != identity) {
      return make_error(ErrorCode::kInvalidInput, name,
                        "another camera answers at {}: {}, it was {}; its images are not used. "
                        "Put the first one back, or reload the configuration to accept this one",
                        options.id, found, identity);
    }
    identity = found;
    ++epoch;
    AravisSource* raw = source.get();
    const auto read = [raw, gauges = clock_gauges(registry, name)] {
      const AravisStatus now = raw->status();
      gauges.drift->set(now.clock_drift);
      gauges.bound->set(to_seconds(now.clock_bound));
      gauges.ptp_slave->set(now.ptp == "Slave" ? 1 : 0);
      gauges.ptp_offset->set(static_cast<double>(now.ptp_offset_ns.value_or(0)) * 1e-9);
      return MeteredSource::Causes{{"lost", now.lost},
                                   {"incomplete", now.incomplete},
                                   {"unusable", now.unusable},
                                   {"copied", now.copied},
                                   {"timed_out", now.aborted},
                                   {"resent_packets", now.resent_packets},
                                   {"missing_packets", now.missing_packets},
                                   {"resend_requests", now.resend_requests},
                                   {"resend_refused", now.resend_refused},
                                   {"resend_limited", now.resend_limited},
                                   {"error_packets", now.error_packets},
                                   {"duplicate_packets", now.duplicate_packets},
                                   {"ignored_packets", now.ignored_packets},
                                   {"size_errors", now.size_errors},
                                   {"triggers", now.triggers},
                                   {"no_buffer", now.underruns},
                                   {"stamp_rejected", now.stamps_rejected},
                                   {"clock_reset", now.clock_resets}};
    };
    return std::unique_ptr<FrameSource>(
        std::make_unique<MeteredSource>(std::move(source), name, registry, read));
  };
}

Result<PixelFormat> SourceFactory::payload_format(const CameraConfig& camera) {
  switch (camera.source) {
    case SourceKind::kReplay:
      return replays_.payload_format(camera);
    case SourceKind::kNetwork:
      return camera.network.url.starts_with("http") ? PixelFormat::kMjpeg : PixelFormat::kI420;
    case SourceKind::kV4l2:
      return is_mjpeg(camera.v4l2.format) ? PixelFormat::kMjpeg : PixelFormat::kI420;
    case SourceKind::kLibcamera:
      return is_mjpeg(camera.libcamera.format) ? PixelFormat::kMjpeg : PixelFormat::kI420;
    case SourceKind::kAravis:
      break;
  }
  return PixelFormat::kI420;
}

}  // namespace sightline
