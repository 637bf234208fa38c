// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libcamera/controls.h>

#include <map>
#include <string>
#include <vector>

#include "sightline/capture/libcamera/libcamera_source.hpp"

namespace sightline::capture {

/// The user's controls as libcamera takes them, each checked against what the camera has.
/// kInvalidInput with the range, the choices, or the controls that there are.
Result<libcamera::ControlList> libcamera_controls(
    const libcamera::ControlInfoMap& offered,
    const std::map<std::string, LibcameraControlValue>& requested, const std::string& where);

/// Differences between what was set and what a frame's metadata tells, a line each. Controls that
/// the camera does not tell are left out.
std::vector<std::string> control_differences(const libcamera::ControlList& set,
                                             const libcamera::ControlList& metadata);

/// "AeEnable, Brightness, ...", sorted.
std::string control_names(const libcamera::ControlInfoMap& offered);

}  // namespace sightline::capture
