// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "sightline/geometry/rigid3.hpp"
#include "sightline/render/raster/ray_table.hpp"
#include "sightline/render/raster/tile.hpp"

namespace sightline {

/// Even rectangle of the frame that holds everything a box in space can touch in the image, grown
/// by `margin_px`; empty if it cannot be seen.
TileRect project_box(const RayTable& rays, const Eigen::Vector3d& min_corner,
                     const Eigen::Vector3d& max_corner, const Rigid3& camera_from_object,
                     int margin_px);

}  // namespace sightline
