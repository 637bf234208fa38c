// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "sightline/base/result.hpp"

namespace sightline::capture {

/// "Device or resource busy", of a negative errno.
std::string libcamera_reason(int negative_errno);

/// "cannot WHAT CAMERA: REASON". kUnavailable: in use, or gone; else kIo.
Error libcamera_error(std::string_view what, std::string_view camera, int negative_errno,
                      const std::string& where);

}  // namespace sightline::capture
