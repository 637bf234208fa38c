// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "capture/common/frame_stamps.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"

namespace sightline::capture {

/// A buffer that came back from the camera, and what came with it.
struct FilledBuffer {
  size_t index = 0;
  size_t bytes_used = 0;  ///< as the camera says: may exceed the buffer
  bool damaged = false;   ///< by the camera's or the driver's own judgment
  uint32_t sequence = 0;
  Time arrival{};              ///< when it was dequeued
  int64_t device_time_ns = 0;  ///< as the camera gave it
  std::optional<Time> stamp;   ///< the same on CLOCK_MONOTONIC; nullopt: of no known clock
  StampPoint stamp_point = StampPoint::kEndOfFrame;
  std::optional<Duration> exposure;  ///< of this frame; nullopt: not known
};

/// Seam of BufferedSource: a camera that is configured and streams into a fixed set of buffers.
/// One thread calls it, but for queue().
class BufferDevice {
 public:
  virtual ~BufferDevice() = default;
  /// "/dev/video0 (HD Webcam)": what messages call it.
  virtual std::string description() const = 0;
  virtual size_t buffer_count() const = 0;
  /// Of one buffer. Memory and descriptor stay valid until destruction, also after stop().
  virtual std::span<const uint8_t> memory(size_t index) const = 0;
  virtual int dmabuf_fd(size_t index) const = 0;  ///< -1: none

  /// Starts streaming with every buffer queued.
  virtual Status start() = 0;
  /// The next filled buffer; nullopt: none within `limit`. An error means that the camera has to be
  /// opened again.
  virtual Result<std::optional<FilledBuffer>> dequeue(Duration limit) = 0;
  /// Hands a buffer to the camera again. Any thread, but never during or after stop().
  virtual Status queue(size_t index) = 0;
  /// Ends streaming and gives the camera back; called once.
  virtual void stop() = 0;

  virtual Time now() const = 0;
};

}  // namespace sightline::capture
