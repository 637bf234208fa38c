// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/measure_twists.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

void measure_twists(const Detection& earlier, Detection& now) {
  const double seconds = to_seconds(now.time - earlier.time);
  if (seconds < kMinTwistSeconds) return;
  for (DetectedPose& pose : now.poses) {
    const auto before =
        std::min_element(earlier.poses.begin(), earlier.poses.end(),
                         [&](const DetectedPose& a, const DetectedPose& b) {
                           return rotation_angle(a.world_from_object, pose.world_from_object) <
                                  rotation_angle(b.world_from_object, pose.world_from_object);
                         });
    pose.twist = difference(before->world_from_object, pose.world_from_object) / seconds;
  }
}

}  // namespace sightline::observe
