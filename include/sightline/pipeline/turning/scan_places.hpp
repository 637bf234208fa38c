// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/head_drive.hpp"

namespace sightline {

/// How far a picture reaches across its middle row and column [rad]; at most 2 on each axis.
HeadAngles view_angles(const CameraModel& model);

/// Where a head looks for what it lost: places within its range, `from` (moved into the range)
/// first, then ring by ring around it, so near to one another that pictures of `view` [rad] overlap
/// by a third and leave nothing out that the range lets them see. At most kMostScanPlaces.
std::vector<HeadAngles> scan_places(const HeadAngles& from, const HeadAngles& view,
                                    const HeadLimits& limits);
constexpr size_t kMostScanPlaces = 500;

}  // namespace sightline
