// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/image/picture.hpp"
#include "sightline/observe/surface_look.hpp"

namespace sightline {

/// The pictures of a mesh's textures, one for each; null, with a warning, for what cannot be read.
std::vector<std::shared_ptr<const Picture>> surface_pictures(const MeshSurface& surface);

/// About `count` spots spread evenly over a mesh's surface, in the colours of its materials,
/// vertices and textures. Empty where the mesh has but one colour. A texture that cannot be read
/// costs a warning and its colours.
Result<std::vector<SurfaceSpot>> surface_spots(const std::filesystem::path& mesh,
                                               double meters_per_unit, size_t count = 1500);

}  // namespace sightline
