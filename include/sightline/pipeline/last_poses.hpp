// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "sightline/config/installation.hpp"
#include "sightline/record/pose_log.hpp"

namespace sightline {

/// Where what has to outlive a restart is kept: the service manager's $STATE_DIRECTORY (its first
/// folder), else $XDG_STATE_HOME/sightline, else ~/.local/state/sightline. Empty if the environment
/// names none.
std::filesystem::path state_folder();

/// File of an installation's last poses in that folder, a pose log with one row for each object;
/// another one for each installation file. Empty if there is no folder.
std::filesystem::path last_poses_file(const Installation& installation);

/// Rows with a pose; none where there is no file. Refused: a file that is damaged.
Result<std::vector<PoseLogRow>> load_last_poses(const std::filesystem::path& file);
/// The same, but of a damaged file none, and the log has a warning: an object is found without it,
/// too.
std::vector<PoseLogRow> read_last_poses(const std::filesystem::path& file);

/// Replaces the file, after its folder is made: aside, synced, renamed.
Status write_last_poses(const std::filesystem::path& file, const std::vector<PoseLogRow>& rows);

}  // namespace sightline
