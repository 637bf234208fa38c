// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/observe/surface_spot.hpp"

namespace sightline::observe {

/// Below it the colours say nothing.
constexpr double kLeastLikeness = 0.3;

/// Correlation of the colours of a surface with a picture of half size (Y, U, V), -1..1, all
/// channels together, each about its own mean; 0 where too little of it shows.
double surface_likeness(std::span<const SurfaceSpot> spots, const CameraModel& camera,
                        const Rigid3& camera_from_object,
                        const std::array<PlaneView, 3>& half_size);

/// -log likelihood of such a correlation, up to a constant: of two normal variables of which so few
/// pairs are independent as neighbouring spots of a print are, n/2 log(1 - r^2).
double likeness_cost(double likeness);

}  // namespace sightline::observe
