// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/libcamera/libcamera_source.hpp"

namespace sightline {
namespace {

Error absent(const std::string& where) {
  return make_error(ErrorCode::kUnavailable, where,
                    "built without libcamera: its cameras need a build with libcamera-dev "
                    "installed");
}

}  // namespace

Result<std::unique_ptr<FrameSource>> open_libcamera_source(const LibcameraOptions&, CameraId,
                                                           const std::string& name,
                                                           const std::stop_token&) {
  return absent(name);
}

Result<std::vector<DeviceInfo>> list_libcamera() { return absent(""); }

std::string libcamera_version() { return "built without libcamera"; }

}  // namespace sightline
