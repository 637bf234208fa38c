// SPDX-License-Identifier: Apache-2.0
#include "capture/libcamera/libcamera_error.hpp"

#include <cerrno>
#include <cstring>

namespace sightline::capture {

std::string libcamera_reason(int negative_errno) { return std::strerror(-negative_errno); }

Error libcamera_error(std::string_view what, std::string_view camera, int negative_errno,
                      const std::string& where) {
  const bool busy = negative_errno == -EBUSY;
  const bool gone = negative_errno == -ENODEV || negative_errno == -EACCES;
  return make_error(busy || gone ? ErrorCode::kUnavailable : ErrorCode::kIo, where,
                    "cannot {} {}: {}{}", what, camera, libcamera_reason(negative_errno),
                    busy ? "; another program is using the camera" : "");
}

}  // namespace sightline::capture
