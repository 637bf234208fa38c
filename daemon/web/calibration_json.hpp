// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "sightline/calibrate/calibration_watch.hpp"
#include "sightline/control/http_content.hpp"
#include "system/config_report.hpp"
#include "system/system.hpp"

namespace sightline {

/// Adds "calibration" to a camera's JSON: what its place is believed to be against
/// `world_from_camera`, the one that it was calibrated at (docs/api.md).
void add_calibration(const CameraWatch& watch, const Rigid3& world_from_camera,
                     const std::filesystem::path& proposal, nlohmann::ordered_json& camera);

/// What is in force, camera by camera, and what is proposed (docs/api.md).
std::string calibration_json(const System& system, const ConfigReport& config);

/// Where the report of the calibration in force is expected: report.html beside it.
std::filesystem::path calibration_report_file(const Installation& installation);
/// A report.html as a page that may do nothing but show itself, or 404 with `missing`; reads the
/// disk.
HttpReply report_reply(const std::filesystem::path& file, const std::string& missing);

}  // namespace sightline
