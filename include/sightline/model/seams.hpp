// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/stream_types.hpp"

namespace sightline {

struct SourceInfo {
  CameraId camera;
  std::string name;
  int width = 0;
  int height = 0;
  double nominal_rate_hz = 0;  ///< 0: unknown
};

/// What one bounded wait for a frame came to.
struct SourceStep {
  enum class Kind { kFrame, kTimeout, kEnd };
  Kind kind = Kind::kTimeout;
  FramePtr frame;  ///< set for kFrame
};

/// Seam of capture: one camera, read by one thread. A device, a recording and a network stream look
/// alike. Destroying it gives the device back; frames that are still held stay valid.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual const SourceInfo& info() const = 0;
  /// Waits at most `timeout` for the next frame. An Error means the source is gone (unplugged, file
  /// damaged): the caller destroys it and may open a new one.
  virtual Result<SourceStep> next(std::stop_token stop, Duration timeout) = 0;
};

/// Seam towards stream and record: takes what a camera shows or sends. Calls never wait; what
/// cannot be taken is dropped and counted by the sink.
class FrameSink {
 public:
  virtual ~FrameSink() = default;
  virtual void accept(const FramePtr& frame) = 0;
};

class ImageSink {
 public:
  virtual ~ImageSink() = default;
  /// True while somebody wants images; without it nothing is drawn or encoded.
  virtual bool wanted() const = 0;
  virtual void accept(const AnnotatedImage& image) = 0;
};

}  // namespace sightline
