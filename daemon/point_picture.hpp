// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/scene_points.hpp"
#include "sightline/render/point_marks.hpp"

namespace sightline {

/// Marks for hundreds of points on an object of a hundred pixels.
inline constexpr PointMarkStyle kManyPoints{2, 5};

/// Appends what of the points a camera's picture shows.
void marks_of_points(const CalibratedCamera& camera, std::span<const ScenePoint> points,
                     std::vector<PointMark>& out);

}  // namespace sightline
