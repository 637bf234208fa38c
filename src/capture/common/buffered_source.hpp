// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "capture/common/access_unit_frames.hpp"
#include "capture/common/buffer_device.hpp"
#include "capture/common/buffer_leases.hpp"
#include "capture/common/bytes_pool.hpp"
#include "capture/common/frame_decoder.hpp"
#include "capture/common/frame_ids.hpp"
#include "capture/common/frame_stamps.hpp"
#include "capture/common/stream_layout.hpp"
#include "sightline/capture/common/capture_counters.hpp"
#include "sightline/model/seams.hpp"

namespace sightline::capture {

struct BufferedSourceOptions {
  uint32_t epoch = 0;                         ///< of this opening; see FrameInfo::epoch
  Duration frame_timeout{0};                  ///< 0: max(1 s, 5 periods); see frame_deadline()
  std::shared_ptr<CaptureCounters> counters;  ///< null: counts for itself
  /// How often a buffer that the device refuses is offered: some drivers refuse for a moment.
  int queue_attempts = 1;
};

/// Frames of a camera that streams into a fixed set of buffers: waits for them, drops the damaged
/// ones, stamps and numbers the rest, lends them as frames, and finds out when the camera is
/// silent.
///
/// A frame holds the camera's own buffer until its last reader lets go; nothing is copied before
/// the first conversion. When fewer than two buffers are left to fill, the next frame is a copy, so
/// that a slow reader costs time, never frames. Every wait is bounded: 100 ms at most, so that a
/// stop request is seen soon, and a deadline after which a camera that sends nothing, or damaged
/// buffers only, counts as lost (kTimeout). The first frame may take five times as long.
///
/// One thread calls next(); nothing is allocated for a frame once warm. Destroying it stops the
/// camera at once, whatever frames are still held.
class BufferedSource final : public FrameSource {
 public:
  /// Starts the camera.
  static Result<std::unique_ptr<FrameSource>> start(std::shared_ptr<BufferDevice> device,
                                                    CameraId camera, const std::string& name,
                                                    const StreamLayout& layout,
                                                    FrameDecoders decoders,
                                                    const BufferedSourceOptions& options);
  BufferedSource(const BufferedSource&) = delete;
  BufferedSource& operator=(const BufferedSource&) = delete;
  ~BufferedSource() override;

  const SourceInfo& info() const override { return info_; }
  Result<SourceStep> next(std::stop_token stop, Duration timeout) override;

 private:
  BufferedSource(std::shared_ptr<BufferDevice> device, SourceInfo info, const StreamLayout& layout,
                 FrameDecoders decoders, const BufferedSourceOptions& options);
  Error silence() const;
  Result<FramePtr> take(const FilledBuffer& buffer);
  Result<FramePtr> take_access_unit(const FilledBuffer& buffer);
  Result<FramePtr> frame_of(const FilledBuffer& buffer);
  std::span<const uint8_t> bytes_of(const FilledBuffer& buffer) const;
  FramePayload payload_of(const FilledBuffer& buffer, std::span<const uint8_t> bytes);
  FrameInfo stamped(const FilledBuffer& buffer);

  const SourceInfo info_;
  const StreamLayout layout_;
  const uint32_t epoch_;
  const Duration deadline_;
  const std::shared_ptr<CaptureCounters> counters_;
  const std::shared_ptr<BufferDevice> device_;
  const std::shared_ptr<BufferLeases> leases_;
  const std::shared_ptr<ImagePool> images_;
  BytesPool copies_;
  const std::unique_ptr<ImageDecoder> decoder_;  // null: raw, or access units
  std::optional<AccessUnitFrames> access_units_;
  FrameIds ids_{FrameIds::Width::k32};
  StampMapper stamps_;
  Time lost_at_;         // unless a frame comes before
  uint64_t faulty_ = 0;  // damaged buffers running
};

}  // namespace sightline::capture
