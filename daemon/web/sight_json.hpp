// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "sightline/pipeline/turning/sight_forecast.hpp"
#include "system/system.hpp"

namespace sightline {

/// The cameras of this host that have a signal and stand somewhere that is known.
std::vector<SightCamera> sight_cameras(const System& system);

/// Adds "sight" to an object's JSON: which cameras can see it, and which will (docs/api.md).
void add_sight(const System& system, const PoseTrack& track,
               const std::vector<SightCamera>& cameras, nlohmann::ordered_json& object);

}  // namespace sightline
