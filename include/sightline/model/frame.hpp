// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>

#include "sightline/base/ids.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/axis_history.hpp"
#include "sightline/image/image.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

enum class FrameStatus : uint8_t { kGood, kDamaged };

/// Which clock `device_time_ns` counts.
enum class ClockLabel : uint8_t { kNone, kMonotonic, kRealtime, kTai, kDevice };

/// Everything known about a frame but its pixels.
struct FrameInfo {
  CameraId camera;
  uint32_t epoch = 0;           ///< grows on every reopen of the source
  uint64_t sequence = 0;        ///< unwrapped; grows within an epoch
  uint32_t dropped_before = 0;  ///< frames lost between the previous one and this one
  FrameStatus status = FrameStatus::kGood;
  ClockLabel device_clock = ClockLabel::kNone;
  int64_t device_time_ns = 0;  ///< raw, as the device said
  Time capture{};              ///< middle of exposure where the source can tell
  Duration time_offset{0};     ///< of the camera's calibration, in `capture` already
  Duration capture_error{0};   ///< bound on |capture - truth|; 0: exact or unknown to the file
  Time arrival{};              ///< when the host had it
  PixelFormat format = PixelFormat::kI420;  ///< of the payload
  int width = 0;
  int height = 0;
  CameraPlacePtr place = nullptr;  ///< of a camera that turns; null: it stands still
};

/// The camera's own bytes: driver buffer, heap or compressed packet. `owner` keeps them alive and
/// gives the buffer back to its source when it dies.
struct FramePayload {
  std::span<const uint8_t> bytes;
  ptrdiff_t stride = 0;  ///< of raw formats; 0: tightly packed
  bool keyframe = true;  ///< false for inter-coded packets
  int dmabuf_fd = -1;    ///< borrowed; -1: none
  std::shared_ptr<const void> owner;
};

class Frame;
/// Frames are immutable and counted; dropping the last reference returns the buffer to its source.
using FramePtr = std::shared_ptr<const Frame>;

/// One image of one camera. Any thread may read any frame.
class Frame {
  struct Key {};  // only the two makers below have it

 public:
  /// A frame whose pixels are decoded already (replay, MJPEG, H.264). `payload` may be empty.
  /// `pool` (of the frame's size) lends the half-size image; without it, that one is allocated.
  static FramePtr decoded(const FrameInfo& info, std::shared_ptr<const Image> image,
                          FramePayload payload = {}, std::shared_ptr<ImagePool> pool = nullptr);
  /// A frame in a raw pixel format; I420 is made from the payload on first demand, into an image
  /// of `pool`. The payload must hold width x height pixels of info.format: the source checks what
  /// the device gave (raw_image_bytes()) before it makes a frame.
  static FramePtr raw(const FrameInfo& info, FramePayload payload, std::shared_ptr<ImagePool> pool);

  /// The same frame, taken so much later: before anybody else has it.
  static FramePtr with_time_offset(const FramePtr& frame, Duration time_offset);
  /// The same frame, taken from there: before anybody else has it.
  static FramePtr with_place(const FramePtr& frame, CameraPlacePtr place);

  Frame(Key, const FrameInfo& info, FramePayload payload, std::shared_ptr<ImagePool> pool,
        std::shared_ptr<const Image> image);

  const FrameInfo& info() const { return info_; }
  const FramePayload& payload() const { return payload_; }

  /// The image in I420, made once and shared; render copies it, never draws into it.
  I420View i420() const;
  /// Writes the image into `to` (same size). Taken from the shared image if that has been made,
  /// else straight from the camera's bytes, without making it: each pixel is touched once.
  void copy_i420_to(const MutableI420View& to) const;
  /// A copy of the image that lets the camera's buffer go, into an image of `pool` (of the frame's
  /// size); wears `camera`. 0.1 ms for 640x480.
  FramePtr copy_for(CameraId camera, std::shared_ptr<ImagePool> pool) const;
  /// The luma plane (of a gray or planar payload without conversion, so gray is full range there).
  PlaneView gray() const;
  /// gray() at half size (width/2 x height/2), made once and shared.
  PlaneView half_gray() const;

 private:
  FrameInfo info_;
  FramePayload payload_;
  std::shared_ptr<ImagePool> pool_;
  bool decoded_;  ///< the image was there from the start
  mutable std::once_flag image_once_, half_once_;
  mutable std::shared_ptr<const Image> image_;
  mutable std::shared_ptr<const Image> half_;
  mutable std::atomic<bool> image_made_{false};
};

}  // namespace sightline
