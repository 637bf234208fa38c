// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/capture/common/device_info.hpp"
#include "sightline/config/installation.hpp"

namespace sightline::cli {

/// How a camera shall send its images, and why so.
struct CameraChoice {
  std::string format;  ///< as the installation spells it; empty: the camera's own
  int width = 0, height = 0;
  double rate_hz = 0;  ///< 0: the camera does not say
  std::string why;     ///< a sentence for the installation file
};

/// The largest images up to 1280x720 at 25 Hz or more, without compression if they come as fast so,
/// in color before gray. `wanted`: this size alone. kInvalidInput where nothing fits; the text has
/// the sizes that the camera offers.
Result<CameraChoice> choose_format(const DeviceInfo& camera, std::optional<ImageSize> wanted);

/// What is listed twice, by two kinds of drivers, once: of USB cameras that V4L2 has, libcamera's
/// entry goes; where libcamera has a camera of the board, V4L2's nodes of boards go, which are
/// parts of it. `left_out` says what went, and which cameras cannot be used at all.
std::vector<DeviceInfo> usable_cameras(const std::vector<DeviceInfo>& devices,
                                       std::vector<std::string>& left_out);

}  // namespace sightline::cli
