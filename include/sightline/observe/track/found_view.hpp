// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/ids.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

/// Where a search has found an object in a frame of one camera.
struct FoundView {
  ObjectId object;
  FramePtr frame;  ///< a copy: no camera waits for its buffer
  Rigid3 camera_from_object;
  bool refutes = false;  ///< the pose that was in force, so what was learned with it is wrong
};

}  // namespace sightline
