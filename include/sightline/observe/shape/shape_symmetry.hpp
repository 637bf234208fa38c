// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/object.hpp"
#include "sightline/model/shape_symmetry.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline {

/// What an object's shape cannot tell and its object file does not declare to mean nothing: the
/// rotations of the mesh onto itself, less those that are declared (of rotations that differ by a
/// declared one only one is kept), and the declared axis.
ShapeSymmetry shape_symmetry_of(const ViewpointModel& views, const ObjectDescription& object);

}  // namespace sightline
