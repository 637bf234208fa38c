// SPDX-License-Identifier: Apache-2.0
// The public functions of builds that have libcamera; libcamera_absent.cpp is the other half.
#include <libcamera/camera_manager.h>
#include <libcamera/control_ids.h>
#include <libcamera/property_ids.h>
#include <libcamera/stream.h>

#include <algorithm>
#include <utility>

#include "capture/common/stop_check.hpp"
#include "capture/libcamera/libcamera_camera.hpp"
#include "capture/libcamera/libcamera_formats.hpp"
#include "capture/libcamera/libcamera_manager.hpp"
#include "capture/libcamera/libcamera_open.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"
#include "sightline/capture/common/device_info.hpp"

namespace sightline {

using namespace capture;

namespace {

using libcamera::Camera;
using libcamera::StreamRole;

std::vector<double> rates_of(const Camera& camera) {
  const auto found = camera.controls().find(libcamera::controls::FrameDurationLimits.id());
  if (found == camera.controls().end()) return {};
  const auto& low = found->second.min();
  const auto& high = found->second.max();
  for (const auto* const value : {&low, &high}) {
    if (value->type() != libcamera::ControlTypeInteger64 || value->isArray()) return {};
    if (value->get<int64_t>() <= 0) return {};
  }
  return {1e6 / static_cast<double>(high.get<int64_t>()),
          1e6 / static_cast<double>(low.get<int64_t>())};
}

DeviceInfo describe(Camera& camera) {
  DeviceInfo info;
  info.scheme = "libcamera";
  info.id = camera.id();
  info.model = camera.properties().get(libcamera::properties::Model).value_or("camera");
  info.where = "libcamera";
  const auto rates = rates_of(camera);
  for (const StreamRole role : {StreamRole::VideoRecording, StreamRole::Raw}) {
    const auto configuration = camera.generateConfiguration({role});
    if (!configuration || configuration->empty()) continue;
    const auto& offered = configuration->at(0).formats();
    for (const auto& pixels : offered.pixelformats()) {
      const FourccFormat* const format = find_libcamera_format(pixels.toString());
      if (format == nullptr || format->kind == FormatKind::kH264) continue;
      for (const auto& size : offered.sizes(pixels)) {
        const FormatInfo mode{std::string(format->name), static_cast<int>(size.width),
                              static_cast<int>(size.height), rates};
        const bool known = std::any_of(info.formats.begin(), info.formats.end(), [&](auto& f) {
          return f.pixel_format == mode.pixel_format && f.width == mode.width &&
                 f.height == mode.height;
        });
        if (!known) info.formats.push_back(mode);
      }
    }
  }
  if (info.formats.empty()) info.note = "no format that Sightline knows";
  return info;
}

}  // namespace

Result<std::unique_ptr<FrameSource>> open_libcamera_source(const LibcameraOptions& options,
                                                           CameraId camera, const std::string& name,
                                                           const std::stop_token& stop) {
  SL_RETURN_IF_ERROR(check_not_stopped(stop, name));
  const Waiting wait("the camera");
  const auto manager = LibcameraManager::get();
  if (!manager) return make_error(manager.error().code, name, "{}", manager.error().text);
  auto found = (*manager)->find(options.id);
  if (!found) {
    std::string others;
    for (const auto& other : (*manager)->cameras()) {
      others += (others.empty() ? "" : ", ") + other->id();
    }
    return make_error(ErrorCode::kUnavailable, name, "libcamera has no camera '{}'; it has: {}",
                      options.id, others.empty() ? "none" : others);
  }
  CameraSignals& signals = (*manager)->signals_of(found);
  SL_ASSIGN(auto device, LibcameraCamera::open(std::move(found), signals, options, name));
  const StreamFormat format = device->stream();
  log::info("{}: {} gives {} {}x{}{}", name, options.id, format.format->name, format.layout.width,
            format.layout.height,
            format.layout.rate_hz > 0 ? fmt::format(" at {:g}/s", format.layout.rate_hz) : "");
  return open_libcamera_source_on(std::move(device), format, options, camera, name);
}

Result<std::vector<DeviceInfo>> list_libcamera() {
  SL_ASSIGN(LibcameraManager * manager, LibcameraManager::get());
  std::vector<DeviceInfo> list;
  for (const auto& camera : manager->cameras()) list.push_back(describe(*camera));
  return list;
}

std::string libcamera_version() {
  return fmt::format("libcamera {}", libcamera::CameraManager::version());
}

}  // namespace sightline
