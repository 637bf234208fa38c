// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/geometry/rigid3.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline {

/// An object whose place is known.
struct KnownObject {
  const ViewpointModel* views = nullptr;
  Rigid3 world_from_object;
};

}  // namespace sightline
