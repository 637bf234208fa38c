// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "sightline/calibrate/calibration_watch.hpp"

namespace sightline {

/// Adds "calibration" to a camera's JSON: what its place is believed to be against
/// `world_from_camera`, the one that it was calibrated at (docs/api.md).
void add_calibration(const CameraWatch& watch, const Rigid3& world_from_camera,
                     const std::filesystem::path& proposal, nlohmann::ordered_json& camera);

}  // namespace sightline
