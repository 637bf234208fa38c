// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "calibrate/solve/bundle.hpp"
#include "calibrate/solve/target_pose.hpp"

namespace sightline::calibrate {

/// Places the cameras of a bundle one after the other along the strongest links, from the pose of
/// the target in each view (`poses` by view of the bundle, empty where there is none), the
/// reference camera at the origin; then the target in each set from the camera that sees it best.
/// All cameras must be linked.
void place_cameras(Bundle& bundle, const std::vector<std::optional<TargetPose>>& poses,
                   size_t reference);

}  // namespace sightline::calibrate
