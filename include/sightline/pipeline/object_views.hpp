// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>

#include "sightline/geometry/mesh.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// Where what can be made again is kept: the service manager's $CACHE_DIRECTORY (its first folder),
/// else $XDG_CACHE_HOME/sightline, else ~/.cache/sightline. Empty if the environment names none.
std::filesystem::path cache_folder();

/// The viewpoint model of a mesh: from the cache, or made (about a second for 15k faces) and put
/// there. `file` names the mesh in errors. `stop` ends the making with kUnavailable within one
/// view.
Result<std::shared_ptr<const ViewpointModel>> load_views(const TriangleMesh& mesh,
                                                         std::shared_ptr<const RenderMesh> shown,
                                                         const std::filesystem::path& file,
                                                         const std::filesystem::path& cache,
                                                         std::stop_token stop = {});

}  // namespace sightline
