// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/track/contour_lines.hpp"
#include "observe/track/print/texture_points.hpp"
#include "observe/track/silhouettes/silhouette_comparison.hpp"
#include "observe/track/symmetry/color_comparison.hpp"
#include "observe/track/tracker_camera.hpp"
#include "sightline/model/observation.hpp"

namespace sightline::observe {

/// Correlation of the mesh's colors with the image at a pose; the object has `samples`.
double print_agreement(const Frame& frame, const Rigid3& world_from_object,
                       const TrackerCamera& camera, const TrackedObject& object);

/// What the mesh's colors, the texture learned and the silhouettes say of a fitted pose and of
/// those that the shape cannot, or hardly, tell from it, as a cost (-log likelihood up to a
/// constant) for each. Empty if nothing is known. `texture`: points that belong to one of the poses
/// beyond doubt; null: none do. `silhouettes`: null: not compared.
std::vector<PoseHypothesis> compare_symmetric_poses(
    const Frame& frame, const Rigid3& fitted, const TrackerCamera& camera,
    const TrackedObject& object, const Occluders& occluders, TexturePoints* texture,
    SilhouetteComparison* silhouettes, ColorComparison* colors);

}  // namespace sightline::observe
