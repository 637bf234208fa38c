// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/control/http_content.hpp"
#include "system/system.hpp"

namespace sightline {

/// Where everything of an installation is, for who wants to draw it (docs/api.md, "The scene").
std::string scene_json(const System& system);
/// The newest stereo points, moved to where their objects are now.
std::string points_json(const System& system);
/// Of the object of that name.
HttpReply object_mesh_reply(const System& system, const std::string& object);
/// Of the static scene; takes a second for each 500,000 triangles beyond what is shown.
HttpReply scene_mesh_reply(const System& system);

}  // namespace sightline
