// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "sightline/base/counters.hpp"
#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/model/seams.hpp"

namespace sightline {

enum class RtspTransport { kAuto, kTcp, kUdp };

/// What became of the connections to a camera, over all openings. Any thread.
struct NetworkCounters {
  Counter slow_closes;  ///< that GStreamer did not let go of within a second
  Counter floods;       ///< given up for what they sent: more than an image, and none in it
};

/// One network camera.
struct NetworkOptions {
  /// "rtsp://[USER:PASSWORD@]HOST[:PORT]/PATH" (H.264, H.265, MJPEG: what GStreamer decodes), or
  /// "http://..." and "https://..." that answer with multipart MJPEG.
  std::string url;
  std::string user, password;  ///< instead of those in the URL
  /// How long RTP packets may be late; only waited for when one is missing.
  int latency_ms = 100;
  RtspTransport transport = RtspTransport::kTcp;  ///< kAuto: UDP, then TCP
  int width = 0, height = 0;                      ///< images of another size are an error; 0: any
  /// Longest wait for the first image (connecting, waiting for a key frame), and for another.
  Duration first_frame_timeout = std::chrono::seconds(10);
  Duration frame_timeout{0};  ///< 0: the longer of 1 s and 5 frame periods, if the stream says
  uint32_t epoch = 0;         ///< of this opening; see FrameInfo::epoch
  std::shared_ptr<NetworkCounters> counters{};  ///< may be null

  bool operator==(const NetworkOptions&) const = default;
};

/// Starts to connect and returns at once; frames, or the reason why there are none, come from
/// next(). Only the newest image waits; those it replaced are in dropped_before.
///
/// Capture times: an RTSP camera that sends sender reports (RFC 3550, 6.4.1) and whose clock agrees
/// with the host's gives the UTC time of each image: device_clock is kRealtime, device_time_ns
/// that time, and capture_error 10 ms, what two hosts on NTP may differ by. Before the first
/// report, for clocks that disagree, and over HTTP, capture is the arrival of the image's first
/// packet, device_clock kNone, and capture_error 500 ms: what cameras may need before they send.
///
/// Errors name the URL without credentials. kInvalidInput: not such a URL, images of another
/// size; kUnavailable: refused, not found, wrong password, GStreamer plugin missing (by package);
/// kTimeout: connected, but silent; kDamaged: it sent 64 MiB (256 KiB before it described itself, 4
/// bytes for each pixel over HTTP) and no image. One thread calls next(); GStreamer runs threads of
/// its own. One that hangs in closing is left to itself: destroying a source takes a second at
/// most, and while three of a name are left, opening another is refused (kUnavailable).
Result<std::unique_ptr<FrameSource>> open_network_source(const NetworkOptions& options,
                                                         CameraId camera, const std::string& name);

/// Whether `url` is one that open_network_source() may be given; kInvalidInput says why not,
/// without repeating it. Any thread.
Status check_network_url(const std::string& url);

/// A URL for messages: without user, password and query.
std::string url_for_messages(const std::string& url);

}  // namespace sightline
