// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// Rotations that may map an object's shape onto itself: the 23 quarter and half turns about its
/// principal axes, without the identity. In the object's axes, about ViewpointModel::center().
std::vector<Eigen::Quaterniond> principal_rotations(const ViewpointModel& model);

/// Turns about one of these axes by what lies between: a spout or a handle that is followed at
/// another side of a body. Every 15 degrees, from 30 on; none about an axis about which it looks
/// nearly the same after any of them, exactly or not.
std::vector<Eigen::Quaterniond> principal_turns(const ViewpointModel& model);

}  // namespace sightline::observe
