// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/aravis/aravis_source.hpp"

namespace sightline {
namespace {

Error absent(const std::string& where) {
  return make_error(ErrorCode::kUnavailable, where,
                    "built without Aravis: GigE Vision and USB3 Vision cameras need a build with "
                    "libaravis-dev and libusb-1.0-0-dev installed");
}

}  // namespace

Result<std::unique_ptr<AravisSource>> open_aravis_source(const AravisOptions&, CameraId,
                                                         const std::string& name, uint32_t,
                                                         const std::stop_token&) {
  return absent(name);
}

Result<std::vector<DeviceInfo>> list_aravis(bool) { return absent(""); }

std::string aravis_version() { return "built without Aravis"; }

}  // namespace sightline
