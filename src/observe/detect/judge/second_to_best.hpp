// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/detect/contour_search.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// Turns after which the shape looks nearly the same.
enum class NearTurns {
  kDiffer,  ///< are other poses
  kSame,    ///< are not: which of them it is, others decide
};

/// Rank of the best of the other poses at the place of the first (within kOtherPlace), as a share
/// of its own; others are those that differ by kDistinctPlace or kDistinctAngle (up to the symmetry
/// of the shape). 0: there is none; `poses`, best first, must not be empty. The ratio test of
/// matching (Lowe, Distinctive Image Features from Scale-Invariant Keypoints, 2004, section 7.1):
/// where the object is, fits from many starts end in one pose, and what else there is is worse; in
/// clutter many poses fit about as well.
double second_to_best(const ViewpointModel& model, const std::vector<ContourPose>& poses,
                      NearTurns near_turns = NearTurns::kDiffer);

}  // namespace sightline::observe
