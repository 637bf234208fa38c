// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/colors/contour_colors.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

void weigh_by_colors(const ColorVerifier& colors, Time time, std::vector<ContourPose>& poses) {
  if (poses.empty()) return;
  const double least = kComparedByColors * poses.front().score;
  std::vector<double> agreement;  // of the poses that matter
  for (const ContourPose& pose : poses) {
    if (pose.score < least) break;
    const RigMotion& motion = pose.fit.motion;
    agreement.push_back(colors.correlation(motion.world_from_object, motion.twist, time));
  }
  const double best = *std::max_element(agreement.begin(), agreement.end());
  if (best < kLeastColors) return;
  for (size_t i = 0; i < agreement.size(); ++i) {
    const double lacks = (best - agreement[i] - kSameColors) / kOtherColors;
    poses[i].score *= 1 - kOtherColorsPenalty * std::clamp(lacks, 0.0, 1.0);
  }
  std::stable_sort(poses.begin(), poses.end(),
                   [](const ContourPose& a, const ContourPose& b) { return a.score > b.score; });
}

}  // namespace sightline::observe
