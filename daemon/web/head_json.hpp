// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "axes/axes_worker.hpp"

namespace sightline {

/// Adds "head" to the JSON of a camera that turns: its angles, and what it follows (docs/api.md).
void add_head(const AxesWorker& head, const Rig& rig, nlohmann::ordered_json& camera);

}  // namespace sightline
