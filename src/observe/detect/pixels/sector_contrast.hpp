// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/detect/pixels/half_size_frame.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// How different the two sides of an outline are, each stretch of it against its own outside, 0..1:
/// the mean over kSectors stretches of 1 less the Bhattacharyya coefficient of their colors, the
/// channels taken as independent. Print and shading that change along the outline do not lower it
/// as they lower outline_contrast(). In an image without colors the coefficient of luma stands for
/// the other channels as well. Stretches that are not in the image count as 0. `sample_step`: every
/// n-th sample of the outline is used.
double sector_contrast(const View& view, const CameraModel& camera,
                       const Rigid3& camera_from_object, const HalfSizeImage& image,
                       size_t sample_step);

}  // namespace sightline::observe
