// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// How much later than the middle row of its image a camera exposes a row [s]:
/// readout_s * (row - (height - 1) / 2) / height, the row [px] held inside the image. (Constant
/// line delay: Liang, Chang and Chen, Analysis and compensation of rolling shutter effect, IEEE
/// Trans. Image Processing 17(8), 2008.)
double row_delay_s(const CalibratedCamera& camera, double row);
/// The same of the row in which it sees a point; zero for one that its lens does not show.
double row_delay_s(const CalibratedCamera& camera, const Eigen::Vector3d& point_in_camera);

}  // namespace sightline
