// SPDX-License-Identifier: Apache-2.0
#include "cameras/camera_probe.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sightline/capture/aravis/aravis_source.hpp"
#include "sightline/capture/libcamera/libcamera_source.hpp"
#include "sightline/capture/network/network_source.hpp"
#include "sightline/capture/v4l2/v4l2_source.hpp"
#include "sightline/image/convert.hpp"

namespace sightline::cli {
namespace {

using namespace std::chrono_literals;

constexpr Duration kFirstFrame = 15s;
constexpr Duration kTurn = 200ms;

struct Measured {
  std::vector<Time> captures;
  std::vector<double> latencies_ms;
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = static_cast<ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<size_t>(at)];
}

const char* clock_name(ClockLabel clock) {
  switch (clock) {
    case ClockLabel::kMonotonic:
      return "the driver (CLOCK_MONOTONIC)";
    case ClockLabel::kRealtime:
      return "the sender's UTC clock";
    case ClockLabel::kTai:
      return "a PTP clock";
    case ClockLabel::kDevice:
      return "the camera's clock, mapped";
    case ClockLabel::kNone:
      break;
  }
  return "the arrival";
}

void note(const Frame& frame, Measured& measured, ProbeReport& report) {
  const FrameInfo& info = frame.info();
  if (report.frames++ > 0) report.dropped += info.dropped_before;
  if (info.status == FrameStatus::kDamaged) ++report.damaged;
  measured.captures.push_back(info.capture);
  measured.latencies_ms.push_back(to_seconds(info.arrival - info.capture) * 1e3);
  report.width = info.width;
  report.height = info.height;
  report.format = to_string(info.format);
  report.clock = clock_name(info.device_clock);
  report.capture_error_ms = std::max(report.capture_error_ms, to_seconds(info.capture_error) * 1e3);
}

void summarize(const Measured& measured, ProbeReport& report) {
  report.latency_ms = quantile(measured.latencies_ms, 0.5);
  report.latency_p99_ms = quantile(measured.latencies_ms, 0.99);
  if (measured.captures.size() < 2) return;
  report.seconds = to_seconds(measured.captures.back() - measured.captures.front());
  std::vector<double> steps_ms;
  for (size_t i = 1; i < measured.captures.size(); ++i) {
    steps_ms.push_back(to_seconds(measured.captures[i] - measured.captures[i - 1]) * 1e3);
  }
  const auto count = static_cast<double>(steps_ms.size());
  if (report.seconds > 0) report.rate_hz = count / report.seconds;
  const double mean = report.seconds * 1e3 / count;
  double squares = 0;
  for (const double step : steps_ms) {
    squares += (step - mean) * (step - mean);
    report.jitter_max_ms = std::max(report.jitter_max_ms, std::abs(step - mean));
  }
  report.jitter_ms = std::sqrt(squares / count);
}

}  // namespace

Result<ProbeResult> run_probe(const Opener& opener, double seconds) {
  const Time start = MonotonicClock::now();
  SL_ASSIGN(const auto source, opener({}));
  ProbeResult result;
  Measured measured;
  Time end = start + kFirstFrame;
  while (MonotonicClock::now() < end) {
    auto next = source->next({}, kTurn);
    if (!next) {
      Error error = std::move(next).error();
      // Silence from the start: it is not there, whatever it answered.
      if (error.code == ErrorCode::kTimeout) error.code = ErrorCode::kUnavailable;
      return error;
    }
    SourceStep step = *std::move(next);
    if (step.kind == SourceStep::Kind::kEnd) break;
    if (step.kind == SourceStep::Kind::kTimeout) continue;
    if (!result.newest) {
      const Time now = MonotonicClock::now();
      result.report.first_frame_s = to_seconds(now - start);
      end = now + from_seconds(seconds);
    }
    note(*step.frame, measured, result.report);
    result.newest = std::move(step.frame);
  }
  if (!result.newest) {
    return make_error(ErrorCode::kUnavailable, "", "it opens, but no frame came in {:.0f} s",
                      to_seconds(kFirstFrame));
  }
  summarize(measured, result.report);
  return result;
}

Result<Opener> bare_opener(const std::string& source) {
  const std::string name = shown_source(source);
  const auto behind = [&source](std::string_view scheme) { return source.substr(scheme.size()); };
  if (source.starts_with("v4l2:")) {
    V4l2Options options;
    options.device = behind("v4l2:");
    return Opener([options, name](const std::stop_token& stop) {
      return open_v4l2_source(options, CameraId(0), name, stop);
    });
  }
  if (source.starts_with("aravis:")) {
    AravisOptions options;
    options.id = behind("aravis:");
    return Opener([options, name](const std::stop_token&) -> Result<std::unique_ptr<FrameSource>> {
      SL_ASSIGN(auto opened, open_aravis_source(options, CameraId(0), name));
      return std::unique_ptr<FrameSource>(std::move(opened));
    });
  }
  if (source.starts_with("libcamera:")) {
    LibcameraOptions options;
    options.id = behind("libcamera:");
    return Opener([options, name](const std::stop_token& stop) {
      return open_libcamera_source(options, CameraId(0), name, stop);
    });
  }
  if (check_network_url(source)) {
    NetworkOptions options;
    options.url = source;
    return Opener([options, name](const std::stop_token&) {
      return open_network_source(options, CameraId(0), name);
    });
  }
  return make_error(ErrorCode::kInvalidInput, "",
                    "this is no source; known: v4l2:DEVICE, aravis:ID, libcamera:ID, "
                    "rtsp://ADDRESS, http://ADDRESS, or with --config the name of a camera");
}

std::string shown_source(const std::string& source) {
  return check_network_url(source) ? url_for_messages(source) : source;
}

}  // namespace sightline::cli
