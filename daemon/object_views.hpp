// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "rig.hpp"
#include "sightline/observe/viewpoint_model.hpp"

namespace sightline {

/// Where what can be made again is kept: the service manager's $CACHE_DIRECTORY (its first folder),
/// else $XDG_CACHE_HOME/sightline, else ~/.cache/sightline. Empty if the environment names none.
std::filesystem::path cache_folder();

/// The viewpoint model of an object of the rig: from the cache, or made (about a second) and
/// put there.
Result<std::shared_ptr<const ViewpointModel>> load_views(const RigObject& object,
                                                         const std::filesystem::path& cache);

}  // namespace sightline
