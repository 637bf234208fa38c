// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "capture/common/buffer_device.hpp"
#include "capture/decode/stream_format.hpp"
#include "sightline/capture/libcamera/libcamera_source.hpp"

namespace sightline::capture {

/// What libcamera says of a request whose buffer has been filled.
struct CompletedRequest {
  size_t buffer = 0;
  bool good = true;
  size_t bytes = 0;
  uint32_t sequence = 0;
  int64_t sensor_ns = 0;    ///< SensorTimestamp; 0: none
  int64_t exposure_ns = 0;  ///< ExposureTime; 0: not told
};

/// The same for the source. `asleep`: CLOCK_BOOTTIME minus CLOCK_MONOTONIC, that is how long the
/// host has slept: libcamera documents the former for SensorTimestamp, what the kernel's drivers
/// give is the latter, so the one that the stamp is nearer to is taken.
FilledBuffer filled_buffer(const CompletedRequest& request, Time arrival, Duration asleep);

/// open_libcamera_source() on a camera that is configured, for tests.
Result<std::unique_ptr<FrameSource>> open_libcamera_source_on(std::shared_ptr<BufferDevice> device,
                                                              const StreamFormat& stream,
                                                              const LibcameraOptions& options,
                                                              CameraId camera,
                                                              const std::string& name);

}  // namespace sightline::capture
