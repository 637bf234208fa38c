// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// Rotations that may map an object's shape onto itself: the 23 quarter and half turns about its
/// principal axes, without the identity. In the object's axes, about ViewpointModel::center().
std::vector<Eigen::Quaterniond> principal_rotations(const ViewpointModel& model);

}  // namespace sightline::observe
