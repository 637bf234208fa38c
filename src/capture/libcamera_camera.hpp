// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/capture/libcamera_source.hpp"
#include "v4l2_formats.hpp"

namespace sightline {

/// What a camera was set to.
struct LibcameraStream {
  const V4l2Format* format = nullptr;  ///< libcamera's formats are V4L2's by other names
  int width = 0, height = 0;
  ptrdiff_t stride = 0;    ///< raw and Bayer
  size_t image_bytes = 0;  ///< least size of a whole picture; 0: compressed
  size_t buffers = 0;
  double rate_hz = 0;  ///< 0: not known
};

/// A buffer that came back.
struct LibcameraShot {
  size_t slot = 0;
  bool good = true;
  size_t bytes = 0;
  uint32_t sequence = 0;
  int64_t sensor_ns = 0;    ///< SensorTimestamp; 0: none
  int64_t exposure_ns = 0;  ///< ExposureTime; 0: not told
};

/// A configured camera, so that libcamera's headers stay behind it and tests can script one. One
/// thread, but for queue().
class LibcameraCamera {
 public:
  virtual ~LibcameraCamera() = default;
  virtual const std::string& id() const = 0;
  virtual const LibcameraStream& stream() const = 0;
  /// Of a buffer; stay valid until destruction, also after close().
  virtual std::span<const uint8_t> memory(size_t slot) const = 0;
  virtual int dmabuf_fd(size_t slot) const = 0;

  /// Starts, with every buffer queued.
  virtual Status start() = 0;
  /// From any thread, not during or after close().
  virtual Status queue(size_t slot) = 0;
  /// The next buffer; nullopt at the limit. kUnavailable: the camera was unplugged.
  virtual Result<std::optional<LibcameraShot>> wait(Duration limit) = 0;
  /// Stops and gives the camera back.
  virtual void close() = 0;

  virtual Time now() const = 0;
  /// CLOCK_BOOTTIME minus CLOCK_MONOTONIC: how long the host has slept.
  virtual Duration time_asleep() const = 0;
};

/// The format that libcamera calls `name` ("R8", "SRGGB10_CSI2P"), or that a user calls so.
const V4l2Format* find_libcamera_format(std::string_view name);

/// open_libcamera_source() on a camera that is there, for tests.
Result<std::unique_ptr<FrameSource>> open_libcamera_source_on(
    std::shared_ptr<LibcameraCamera> device, const LibcameraOptions& options, CameraId camera,
    const std::string& name);

}  // namespace sightline
