// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/libcamera/libcamera_source.hpp"

#include <chrono>
#include <utility>

#include "capture/common/buffered_source.hpp"
#include "capture/libcamera/libcamera_open.hpp"

namespace sightline::capture {
namespace {

// Clocks further apart than this are told apart by the stamp; closer, it does not matter which.
constexpr Duration kSameClock = std::chrono::microseconds(100);

std::optional<Time> monotonic(int64_t sensor_ns, Time arrival, Duration asleep) {
  if (sensor_ns <= 0) return std::nullopt;
  const Time stamp = time_from_ns(sensor_ns);
  if (asleep < kSameClock) return stamp;
  const auto distance = [arrival](Time t) { return t > arrival ? t - arrival : arrival - t; };
  return distance(stamp - asleep) < distance(stamp) ? stamp - asleep : stamp;
}

}  // namespace

FilledBuffer filled_buffer(const CompletedRequest& request, Time arrival, Duration asleep) {
  FilledBuffer filled;
  filled.index = request.buffer;
  filled.bytes_used = request.bytes;
  filled.damaged = !request.good;
  filled.sequence = request.sequence;
  filled.arrival = arrival;
  filled.device_time_ns = request.sensor_ns;
  filled.stamp = monotonic(request.sensor_ns, arrival, asleep);
  filled.stamp_point = StampPoint::kStartOfExposure;
  if (request.exposure_ns > 0) filled.exposure = Duration(request.exposure_ns);
  return filled;
}

Result<std::unique_ptr<FrameSource>> open_libcamera_source_on(std::shared_ptr<BufferDevice> device,
                                                              const StreamFormat& stream,
                                                              const LibcameraOptions& options,
                                                              CameraId camera,
                                                              const std::string& name) {
  SL_ASSIGN(FrameDecoders decoders, make_decoders(stream, name));
  BufferedSourceOptions source;
  source.epoch = options.epoch;
  source.frame_timeout = options.frame_timeout;
  source.counters = options.counters;
  return BufferedSource::start(std::move(device), camera, name, stream.layout, std::move(decoders),
                               source);
}

}  // namespace sightline::capture
