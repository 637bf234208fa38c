// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "sightline/observe/surface_look.hpp"

namespace sightline {

/// About `count` spots spread evenly over a mesh's surface, in the colours of its materials,
/// vertices and textures. Empty where the mesh has but one colour. A texture that cannot be read
/// costs a warning and its colours.
Result<std::vector<SurfaceSpot>> surface_spots(const std::filesystem::path& mesh,
                                               double meters_per_unit, size_t count = 1500);

}  // namespace sightline
