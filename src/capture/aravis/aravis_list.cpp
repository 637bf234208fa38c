// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/aravis_configure.hpp"
#include "capture/aravis/aravis_discovery.hpp"
#include "sightline/capture/aravis/aravis_source.hpp"

namespace sightline {

using namespace capture;

namespace {

void add_formats(ArvCamera* camera, DeviceInfo& info) {
  int low = 0, width = 0, height = 0;
  ask(0, [&](GError** e) { return arv_camera_get_width_bounds(camera, &low, &width, e), 0; });
  ask(0, [&](GError** e) { return arv_camera_get_height_bounds(camera, &low, &height, e), 0; });
  double slowest = 0, fastest = 0;
  ask(0, [&](GError** e) {
    return arv_camera_get_frame_rate_bounds(camera, &slowest, &fastest, e), 0;
  });
  for (const std::string& name : usable_formats(camera)) {
    FormatInfo format;
    format.pixel_format = name;
    format.width = width;
    format.height = height;
    if (fastest > 0) format.rates_hz = {slowest, fastest};
    info.formats.push_back(std::move(format));
  }
  if (info.formats.empty()) info.note = "none of its pixel formats can be used";
}

}  // namespace

Result<std::vector<DeviceInfo>> list_aravis(bool formats) {
  std::vector<DeviceInfo> devices;
  for (const FoundCamera& found : discover_aravis()) {
    DeviceInfo info;
    info.scheme = "aravis";
    info.id = found.id;
    info.model = found.vendor.empty() ? found.model : found.vendor + " " + found.model;
    info.serial = found.serial;
    info.where = found.gige ? found.address : "USB";
    if (formats) {
      if (auto camera = connect_aravis(found, "", "")) {
        add_formats(camera->get(), info);
      } else {
        info.note = camera.error().text;
      }
    }
    devices.push_back(std::move(info));
  }
  return devices;
}

}  // namespace sightline
