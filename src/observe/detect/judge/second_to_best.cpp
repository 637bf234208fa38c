// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/second_to_best.hpp"

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

double second_to_best(const ViewpointModel& model, const std::vector<ContourPose>& poses) {
  const ContourPose& best = poses.front();
  const Rigid3& pose = best.fit.motion.world_from_object;
  double second = 0;
  for (const ContourPose& other : poses) {
    const Rigid3& at = other.fit.motion.world_from_object;
    const double apart = (at * model.center() - pose * model.center()).norm() / model.radius();
    if (apart > kOtherPlace || other.rank <= second) continue;
    if (apart > kDistinctPlace || model.angle_up_to_symmetry(at, pose) > kDistinctAngle) {
      second = other.rank;
    }
  }
  return best.rank > 0 ? second / best.rank : 1;
}

}  // namespace sightline::observe
