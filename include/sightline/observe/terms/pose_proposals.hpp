// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/pose_term.hpp"

namespace sightline {

/// A pose that something beside the outline proposes: trained features.
struct ProposedPose {
  Rigid3 world_from_object;  ///< at the time of the proposals
  Vector6 twist = Vector6::Zero();
  double evidence = 0;  ///< of its own; 1 is as good as the outlines in two cameras
  size_t matches = 0;   ///< that support it
  /// The object's print agrees with the images: no outline is asked for, much of it may be hidden.
  bool confirmed = false;
  std::vector<PoseTermPtr> terms;  ///< by camera of the detector, what it measured; null: nothing
};

struct PoseProposals {
  Time time{};
  std::vector<ProposedPose> poses;  ///< best first
};

}  // namespace sightline
