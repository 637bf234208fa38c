// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include "sightline/image/image.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

/// Whether a camera's frames come, since when not, and the last image there was. Written by the
/// capture thread, read by any.
class SignalWatch {
 public:
  /// The signal is lost without a frame for the longer of 0.8 s and five periods.
  SignalWatch(int width, int height, Time start);

  void set_rate(double rate_hz);  ///< nominal, of the source; 0: unknown
  /// The source is open: time for its first frame.
  void source_open(Time now);
  void good_frame(const FramePtr& frame);
  /// The source is gone: lets go of its last frame (devices come back only when all buffers are
  /// given back) and keeps a copy of the image.
  void source_gone();

  /// When the last frame came (or the watch began) if there is no signal now.
  std::optional<Time> lost_since(Time now) const;
  /// The open source has been silent for the longer of a second and five periods; its first frame
  /// may take five times as long, as network cameras are still connecting.
  bool stalled(Time now) const;
  Duration deadline() const;

  struct Last {
    FrameInfo frame;                     ///< all zero before the first
    std::shared_ptr<const Image> image;  ///< null before the first
  };
  Last last() const;

 private:
  std::shared_ptr<const Image> copy_of(const FramePtr& frame) const;

  const int width_, height_;
  mutable std::mutex mutex_;
  Duration lost_after_, deadline_;
  bool open_ = true;  // nothing is known yet
  Time last_time_;    // of the last frame, or of the start
  Time opened_;
  bool fresh_ = true;  // no frame since it was opened
  FramePtr newest_;    // only while the source is open
  Last kept_;
};

}  // namespace sightline
