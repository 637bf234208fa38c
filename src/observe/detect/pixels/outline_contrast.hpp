// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/detect/pixels/half_size_frame.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/foreground_map.hpp"

namespace sightline::observe {

/// How different both sides of an outline are in an image, 0..1: in their colors (1 less the
/// Bhattacharyya coefficient of the histograms), or in that one is foreground and the other
/// background, if that is more. `foreground` null: not known.
double outline_contrast(const View& view, const CameraModel& camera,
                        const Rigid3& camera_from_object, const HalfSizeImage& image,
                        const ForegroundMap* foreground);

}  // namespace sightline::observe
