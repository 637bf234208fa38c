// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/observe/shape/surface_sample.hpp"

namespace sightline::observe {

/// Below it the colors say nothing.
constexpr double kMinCorrelation = 0.3;

/// Correlation of the colors of a surface with an image of half size (Y, U, V), -1..1, all
/// channels together, each about its own mean; 0 where too little of it shows.
double color_correlation(std::span<const SurfaceSample> samples, const CameraModel& camera,
                         const Rigid3& camera_from_object,
                         const std::array<PlaneView, 3>& half_size);

/// -log likelihood of such a correlation, up to a constant: of two normal variables of which so few
/// pairs are independent as neighboring spots of a print are, n/2 log(1 - r^2).
double correlation_cost(double correlation);

}  // namespace sightline::observe
