// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// Where the mask of a view lies in an image.
struct PlacedMask {
  size_t view = 0;
  double x = 0, y = 0;      ///< of its middle [px]
  double radius = 0;        ///< half of its side [px]
  double cos = 1, sin = 0;  ///< of the turn of its axes in the image
};

/// The nearest view of an object at a pose, in weak perspective; empty: behind the camera, or
/// around it.
std::optional<PlacedMask> place_mask(const ViewpointModel& model, const CameraModel& camera,
                                     const Rigid3& camera_from_object);

/// Overlap over union of the silhouettes of two objects in one camera, 0..1, as if nothing were
/// in front of either.
double silhouette_overlap(const ViewpointModel& first, const PlacedMask& first_at,
                          const ViewpointModel& second, const PlacedMask& second_at);

}  // namespace sightline::observe
