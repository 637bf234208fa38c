// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/image/image.hpp"
#include "sightline/observe/shape/surface_sample.hpp"

namespace sightline {

/// The images of a mesh's textures, one for each; null for what cannot be read.
using SurfaceImages = std::vector<std::shared_ptr<const Image>>;
/// Reads one of them; the error names the file.
Result<std::shared_ptr<const Image>> read_texture(const MeshSurface& surface, size_t index);
/// Reads them all; one that cannot be read costs a warning and its colors.
SurfaceImages surface_images(const MeshSurface& surface);

/// About `count` spots spread evenly over a mesh's surface, in the colors of its materials,
/// vertices and `images`. Empty where the mesh has but one color.
std::vector<SurfaceSample> surface_samples(const MeshSurface& surface, const SurfaceImages& images,
                                           size_t count = 1500);

}  // namespace sightline
