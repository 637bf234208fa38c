// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/observation.hpp"

namespace sightline::pipeline {

/// What was observed of an object at `left * pose * right`, said of `pose` (world_from_object).
/// Tangents are the object's, so `left` leaves information and gradients alone:
///     left X exp(d) right = left X right exp(Ad(right^-1) d)
void say_of_pose(const Rigid3& left, const Rigid3& right, Observation& observation);

}  // namespace sightline::pipeline
