// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/lookalikes.hpp"
#include "sightline/model/object.hpp"
#include "sightline/observe/viewpoint_model.hpp"

namespace sightline {

/// What an object's shape cannot tell and its object file does not declare to mean nothing: the
/// turns of the mesh onto itself, less those that are declared (of turns that differ by a declared
/// one only one is kept), and the declared axis.
Lookalikes lookalikes_of(const ViewpointModel& views, const ObjectDescription& object);

}  // namespace sightline
