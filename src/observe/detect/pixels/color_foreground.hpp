// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/detect/pixels/half_size_frame.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/foreground_map.hpp"

namespace sightline::observe {

/// What looks like the object rather than like its surroundings: colors are learned on both sides
/// of its outline at one pose, and looked up around it (pixel-wise posteriors, Bibby and Reid, ECCV
/// 2008). Even at a pose that is rotated wrongly most of what is inside is the object. Unknown:
/// colors that both have, and all that is further away than one and a half radii. `center` [half-
/// size px] and `radius_px` of the object.
ForegroundMap color_foreground(const View& view, const CameraModel& camera,
                               const Rigid3& camera_from_object, const HalfSizeImage& image,
                               const Eigen::Vector2d& center, double radius_px);

}  // namespace sightline::observe
