// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "observe/fiducial/fiducial_object.hpp"
#include "sightline/model/observation.hpp"

namespace sightline::observe {

/// How many markers and boards a measurement took, and how many single markers it refused.
struct FiducialCounts {
  size_t accepted = 0, refused = 0;
};

/// From the markers found in a frame to a measurement of the pose: board corners are located,
/// single markers that contradict the others are dropped (from `object` too), and one
/// ReprojectionTerm over all corners and the stand-alone poses are added to `out`. Nothing is added
/// where nothing is left.
FiducialCounts measure_fiducials(FiducialObject& object, const PlaneView& gray,
                                 const std::shared_ptr<const CalibratedCamera>& camera,
                                 const FiducialOptions& options, Observation& out);

}  // namespace sightline::observe
