// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/stream_types.hpp"

namespace sightline {

struct EncoderOptions {
  int width = 0;  ///< even
  int height = 0;
  double rate_hz = 30;         ///< nominal; images may come at any time
  int bitrate_kbps = 0;        ///< 0: by size, see default_bitrate_kbps()
  int keyframe_interval = 60;  ///< images from one key frame to the next, at most
  /// Shortest time between two key frames made by request_keyframe().
  Duration keyframe_request_spacing = std::chrono::milliseconds(250);
  /// GStreamer element names to try, best first. Empty: known_h264_encoders().
  std::vector<std::string> prefer;

  bool operator==(const EncoderOptions&) const = default;
};

/// 4000 kbit/s at 1280x720 and 8000 at 1920x1080, between and beyond by the power law through them.
int default_bitrate_kbps(int width, int height);

/// Elements tried by default, in this order: hardware first (V4L2 M2M, VA, NVENC), then x264, then
/// OpenH264.
std::span<const std::string> known_h264_encoders();

/// True if the element exists and has encoded one small image. Asked once per process and element,
/// for a few seconds, then remembered. One that gave no answer in this time is no longer waited
/// for, but used once it has answered; any thread.
bool h264_encoder_works(const std::string& element);

struct EncoderCounts {
  uint64_t pushed = 0;   ///< images handed in
  uint64_t encoded = 0;  ///< packets handed out
  uint64_t dropped = 0;  ///< images replaced by a newer one, or lost to a failed encoder
};

/// One camera's H.264 encoder: images in, one access unit out for each, without delay (no
/// B frames, no look-ahead, no frame threads). Constrained baseline, Annex B, parameter sets before
/// every key frame, and an SEI unit with frame number, capture time and poses (stream/sei.hpp).
///
/// Threads: push(), request_keyframe() and the getters from any thread. `on_packet` is called on
/// the encoder's own (GStreamer) thread; it must not block for long nor destroy the encoder. The
/// destructor waits for a call that is under way; afterwards there are none.
class VideoEncoder {
 public:
  using OnPacket = std::function<void(EncodedPacket)>;

  /// Picks the first encoder of `options.prefer` that works. kUnavailable names the Debian package
  /// to install if none does; kInvalidInput for a size that H.264 4:2:0 cannot take.
  static Result<std::unique_ptr<VideoEncoder>> create(const EncoderOptions& options,
                                                      std::string camera_name, OnPacket on_packet);
  ~VideoEncoder();
  VideoEncoder(const VideoEncoder&) = delete;
  VideoEncoder& operator=(const VideoEncoder&) = delete;

  /// Hands an image over without copying it (the encoder keeps a reference) and without waiting.
  /// At most one image waits while another is being encoded; a newer one replaces it and the
  /// loss is counted. An image of the wrong size is dropped and counted.
  void push(const AnnotatedImage& image, std::span<const NamedObject> names);

  /// The same for offline work (overlay videos): waits for the encoder instead of dropping.
  Status push_and_wait(const AnnotatedImage& image, std::span<const NamedObject> names,
                       Duration timeout);

  /// Ends the stream: returns when all packets were handed out. Nothing may be pushed afterwards.
  Status finish(Duration timeout);

  /// Makes one of the next images a key frame: the next one, or the first after
  /// `keyframe_request_spacing`. Many requests make one key frame.
  void request_keyframe();

  /// Element name, e.g. "x264enc".
  const std::string& encoder_name() const;
  EncoderCounts counts() const;
  /// Why the encoder stopped (device lost, driver error), if it has; then destroy it and make a new
  /// one.
  std::optional<Error> failure() const;

 private:
  struct Impl;
  explicit VideoEncoder(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
