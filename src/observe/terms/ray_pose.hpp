// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/terms/rig_pose.hpp"

namespace sightline::observe {

/// Starts of solve_rig(): poses (world_from_object) of three matches that the rays of all cameras
/// support most, best first, no two close together.
std::vector<Rigid3> ray_poses(std::span<const RigView> views, std::span<const RigMatch> matches,
                              const RigPoseOptions& options);

}  // namespace sightline::observe
