// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

/// The frames that come while a search runs, so that what it finds can be carried through them to
/// now. Copies, so that no camera waits for its buffers; at most so many per camera: when there are
/// more, every second one is dropped and the rest span twice the time. Any thread.
class FrameTrail {
 public:
  static constexpr size_t kMaxFrames = 16;

  /// `cameras`: of the installation; `max_frames`: per camera, at least 2.
  explicit FrameTrail(size_t cameras, size_t max_frames = kMaxFrames);

  /// Keeps frames from now on; those that are kept already are forgotten.
  void open();
  /// Keeps none any more.
  void close();
  /// Copies the frame (0.1 ms for 640x480) if the trail is open and the frame is not damaged. The
  /// copy wears `camera`.
  void push(CameraId camera, const Frame& frame);
  /// Takes the newest frame of each camera that was captured by `time`; drops what is older.
  std::vector<FramePtr> take_until(Time time);
  /// Capture of the newest frame that is kept; none: Time::min().
  Time newest() const;

 private:
  struct Camera {
    std::deque<FramePtr> frames;  // oldest first
    int width = 0, height = 0;
    std::shared_ptr<ImagePool> pool;  // of that size
    size_t skip = 0, skipped = 0;  // of the frames that come, `skip` are left out before the next
  };
  std::shared_ptr<ImagePool> pool_of(Camera& camera, const FrameInfo& info) const;

  const size_t max_frames_;
  mutable std::mutex mutex_;
  bool open_ = false;
  std::vector<Camera> cameras_;  // by CameraId
};

}  // namespace sightline
