// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "axes/angle_worker.hpp"
#include "axes/axes_worker.hpp"

namespace sightline {

/// Adds "head" to the JSON of a camera that turns: its angles, and what it follows (docs/api.md).
void add_head(const AxesWorker& head, const Rig& rig, nlohmann::ordered_json& camera);
/// Adds "angles_by_picture": what its picture says of its angles and of their latency.
void add_angles(const RefinerStatus& status, nlohmann::ordered_json& camera);

}  // namespace sightline
