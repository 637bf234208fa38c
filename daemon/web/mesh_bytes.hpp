// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "sightline/render/mesh/level_of_detail.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// So many triangles are worth showing in a browser.
inline constexpr size_t kShownFaces = 20'000;

/// The finest level with at most kShownFaces triangles, else the coarsest.
const RenderMesh& shown_level(const LevelOfDetail& levels);

/// Meshes of one frame as one, as docs/api.md describes ("Meshes"): little-endian, "SLM1", counts,
/// box, vertices as 16-bit shares of the box, triangles by index.
std::string mesh_bytes(std::span<const RenderMesh* const> meshes);

}  // namespace sightline
