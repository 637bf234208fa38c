// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/second_to_best.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

bool same_orientation(const ViewpointModel& model, const Rigid3& a, const Rigid3& b,
                      NearTurns near_turns) {
  if (model.angle_up_to_symmetry(a, b) <= kDistinctAngle) return true;
  if (near_turns == NearTurns::kDiffer) return false;
  return std::ranges::any_of(model.near_rotations(), [&](const Rigid3& turn) {
    return model.angle_up_to_symmetry(a, b * turn) <= kDistinctAngle;
  });
}

}  // namespace

double second_to_best(const ViewpointModel& model, const std::vector<ContourPose>& poses,
                      NearTurns near_turns) {
  const ContourPose& best = poses.front();
  const Rigid3& pose = best.fit.motion.world_from_object;
  double second = 0;
  for (const ContourPose& other : poses) {
    const Rigid3& at = other.fit.motion.world_from_object;
    const double apart = (at * model.center() - pose * model.center()).norm() / model.radius();
    if (apart > kOtherPlace || other.rank <= second) continue;
    if (apart > kDistinctPlace || !same_orientation(model, at, pose, near_turns)) {
      second = other.rank;
    }
  }
  return best.rank > 0 ? second / best.rank : 1;
}

}  // namespace sightline::observe
