// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "calibrate/solve/lens_projection.hpp"
#include "sightline/calibrate/views.hpp"

namespace sightline::calibrate {

/// What a corner was measured at, had its camera taken it at the time of the set [px], and the
/// derivatives of that by time offset and read-out [px/s].
struct CornerAtSet {
  Eigen::Vector2d pixel;
  Eigen::Vector2d by_offset = Eigen::Vector2d::Zero(), by_readout = Eigen::Vector2d::Zero();
};

/// Of a camera with these values and images of so many rows [px]; 0: its read-out is left out. Rows
/// of a rolling shutter are exposed one after the other, the middle one at the frame's time
/// (row_delay_s()). So two looks at a corner that moves down or up are not apart by as much as
/// their frames, and px_per_s, which takes them for that, is not its speed: it is too large by the
/// factor 1 + readout px_per_s.y / height.
CornerAtSet corner_at_set(const TargetView& view, const TargetCorner& corner, const double* values,
                          int height);

/// The place alone, with time offset and read-out of a calibrated camera.
Eigen::Vector2d pixel_at_set(const TargetView& view, const TargetCorner& corner,
                             const CalibratedCamera& camera);

}  // namespace sightline::calibrate
