// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "sightline/model/seams.hpp"

namespace sightline::cli {

using Opener = std::function<Result<std::unique_ptr<FrameSource>>(const std::stop_token& stop)>;

/// What a camera did while it was probed. Times are in the unit of the name.
struct ProbeReport {
  std::string source;
  int width = 0, height = 0;
  std::string format;
  uint64_t frames = 0, dropped = 0, damaged = 0;
  double seconds = 0;        ///< from the first frame to the last
  double first_frame_s = 0;  ///< from opening
  double rate_hz = 0;
  double jitter_ms = 0, jitter_max_ms = 0;    ///< of the interval between captures
  double latency_ms = 0, latency_p99_ms = 0;  ///< capture to arrival
  double capture_error_ms = 0;                ///< largest bound
  std::string clock;
};

struct ProbeResult {
  ProbeReport report;
  FramePtr newest;
};

/// Takes frames for so long, counted from the first. kUnavailable if none comes.
Result<ProbeResult> run_probe(const Opener& opener, double seconds);

/// Opens a source named as in an installation ("v4l2:...", "aravis:...", "libcamera:...",
/// "rtsp://...") with the camera's own settings.
Result<Opener> bare_opener(const std::string& source);

/// For messages: without credentials.
std::string shown_source(const std::string& source);

}  // namespace sightline::cli
