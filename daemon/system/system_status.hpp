// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "heartbeat.hpp"
#include "system/config_report.hpp"
#include "system/system.hpp"

namespace sightline {

/// One line for a person: cameras present, objects' states, and what is wrong.
std::string status_line(const System& system, const ConfigReport& config,
                        const std::vector<ThreadWait>& waits);

/// What /api/state says (docs/operation.md).
std::string state_json(const System& system, const ConfigReport& config,
                       const std::vector<ThreadWait>& waits);

}  // namespace sightline
