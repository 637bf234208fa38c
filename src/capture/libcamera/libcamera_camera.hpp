// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libcamera/camera.h>
#include <libcamera/controls.h>
#include <libcamera/framebuffer_allocator.h>
#include <libcamera/request.h>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/common/buffer_device.hpp"
#include "capture/decode/stream_format.hpp"
#include "capture/libcamera/libcamera_signals.hpp"
#include "capture/libcamera/mapped_frame_buffer.hpp"
#include "sightline/capture/libcamera/libcamera_source.hpp"

namespace sightline::capture {

/// A configured camera of libcamera with its buffers, each in a request of its own.
class LibcameraCamera final : public BufferDevice {
 public:
  /// Acquires and configures `camera`. `signals` are the camera's, `where` its name for messages.
  static Result<std::shared_ptr<LibcameraCamera>> open(std::shared_ptr<libcamera::Camera> camera,
                                                       CameraSignals& signals,
                                                       const LibcameraOptions& options,
                                                       const std::string& where);
  LibcameraCamera(const LibcameraCamera&) = delete;
  LibcameraCamera& operator=(const LibcameraCamera&) = delete;
  ~LibcameraCamera() override { LibcameraCamera::stop(); }

  const StreamFormat& stream() const { return stream_; }

  std::string description() const override { return id_; }
  size_t buffer_count() const override { return memory_.size(); }
  std::span<const uint8_t> memory(size_t index) const override { return memory_[index].bytes(); }
  int dmabuf_fd(size_t index) const override { return memory_[index].fd(); }
  Status start() override;
  Result<std::optional<FilledBuffer>> dequeue(Duration limit) override;
  Status queue(size_t index) override;
  void stop() override;
  Time now() const override { return MonotonicClock::now(); }

 private:
  LibcameraCamera(std::shared_ptr<libcamera::Camera> camera, CameraSignals& signals,
                  std::string where);
  Status set_up(const LibcameraOptions& options);
  Status allocate();
  void set_rate(double rate_hz);
  bool has_devices() const;
  Error error(std::string_view what, int negative_errno) const;

  std::shared_ptr<libcamera::Camera> camera_;  // null once stopped
  CameraSignals& signals_;
  const std::string id_, where_;
  std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
  std::vector<std::unique_ptr<libcamera::Request>> requests_;
  std::vector<MappedFrameBuffer> memory_;
  StreamFormat stream_;
  libcamera::ControlList controls_;
  std::shared_ptr<CompletedRequests> completed_;
  bool running_ = false;
};

}  // namespace sightline::capture
