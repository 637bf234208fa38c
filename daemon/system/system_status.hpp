// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heartbeat.hpp"
#include "system/config_report.hpp"
#include "system/system.hpp"
#include "web/pose_feed.hpp"

namespace sightline {

/// One line for a person: cameras present, objects' states, and what is wrong.
std::string status_line(const System& system, const ConfigReport& config,
                        const std::vector<ThreadWait>& waits);

/// For people, or for a line of a stream.
enum class Layout { kLines, kOneLine };

/// What /api/v1/state and the others say (docs/api.md). The system has been started.
std::string state_json(const System& system, const ConfigReport& config,
                       const std::vector<ThreadWait>& waits, Layout layout = Layout::kLines);
std::string cameras_json(const System& system);
std::string objects_json(const System& system);
/// One of them; nullopt where none has that name.
std::optional<std::string> camera_json(const System& system, const std::string& name);
std::optional<std::string> object_json(const System& system, const std::string& name);
/// What ids mean, by the installation; the rig has been loaded.
FeedNames feed_names(const System& system);
/// The newest estimate of every object.
std::string poses_json(const System& system);

}  // namespace sightline
