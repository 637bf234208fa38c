// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/v4l2/v4l2_source.hpp"

#include <algorithm>

#include "capture/common/buffered_source.hpp"
#include "capture/common/stop_check.hpp"
#include "capture/v4l2/v4l2_buffers.hpp"
#include "capture/v4l2/v4l2_device.hpp"
#include "capture/v4l2/v4l2_open.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"
#include "sightline/image/h264.hpp"

namespace sightline::capture {
namespace {

constexpr int kMinBuffers = 4, kMaxBuffers = 6;
constexpr int kQueueAttempts = 5;

}  // namespace

Result<std::unique_ptr<FrameSource>> open_v4l2_source_in(const V4l2Options& options,
                                                         CameraId camera, const std::string& name,
                                                         const V4l2Places& places,
                                                         const std::shared_ptr<V4l2System>& system,
                                                         const std::stop_token& stop) {
  const Waiting wait("the camera");
  SL_ASSIGN(const V4l2Node node, choose_v4l2_node(options.device, find_v4l2_nodes(places), name));
  SL_ASSIGN(V4l2Device device, V4l2Device::open(system, node.path, name));
  SL_RETURN_IF_ERROR(check_not_stopped(stop, name));
  SL_ASSIGN(const StreamFormat stream, negotiate_v4l2(device, options));
  SL_RETURN_IF_ERROR(set_v4l2_controls(device, options.controls, stop));
  const auto exposure = v4l2_exposure(device);
  SL_ASSIGN(FrameDecoders decoders, make_decoders(stream, name));
  const int count = std::clamp(options.buffers, kMinBuffers, kMaxBuffers);
  SL_ASSIGN(auto buffers,
            V4l2Buffers::map(std::move(device), count, stream.layout.image_bytes, exposure));
  SL_ASSIGN(auto source,
            BufferedSource::start(
                std::move(buffers), camera, name, stream.layout, std::move(decoders),
                {options.epoch, options.frame_timeout, options.counters, kQueueAttempts}));
  log::info("{}: {} ({}) gives {} {}x{} at {:g}/s", name, node.path, node.card, stream.format->name,
            stream.layout.width, stream.layout.height, stream.layout.rate_hz);
  return source;
}

}  // namespace sightline::capture

namespace sightline {

Result<std::unique_ptr<FrameSource>> open_v4l2_source(const V4l2Options& options, CameraId camera,
                                                      const std::string& name,
                                                      const std::stop_token& stop) {
  return capture::open_v4l2_source_in(options, camera, name, {}, capture::real_v4l2_system(), stop);
}

}  // namespace sightline
