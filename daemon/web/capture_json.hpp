// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibration/capture_service.hpp"
#include "calibration/capture_targets.hpp"

namespace sightline {

/// What a capture of target views is at (docs/api.md).
std::string capture_json(const CaptureShown& shown);
/// What may be shown to the cameras, by name.
std::string capture_targets_json(const std::vector<NamedTarget>& targets);

}  // namespace sightline
