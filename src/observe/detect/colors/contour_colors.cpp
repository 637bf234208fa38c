// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/colors/contour_colors.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

std::vector<double> color_weights(std::span<const double> agreement, double least) {
  std::vector<double> out(agreement.size(), 1.0);
  if (agreement.empty()) return out;
  const double best = *std::max_element(agreement.begin(), agreement.end());
  if (best < least) return out;
  for (size_t i = 0; i < out.size(); ++i) {
    const double lacks = (best - agreement[i] - kSameColors) / kOtherColors;
    out[i] -= kOtherColorsPenalty * std::clamp(lacks, 0.0, 1.0);
  }
  return out;
}

void weigh_by_colors(const ColorVerifier& colors, Time time, double least,
                     std::vector<ContourPose>& poses) {
  if (poses.empty()) return;
  const double compared = kComparedByColors * poses.front().rank;
  std::vector<double> agreement;  // of the poses that matter
  for (const ContourPose& pose : poses) {
    if (pose.rank < compared) break;
    const RigMotion& motion = pose.fit.motion;
    agreement.push_back(colors.correlation(motion.world_from_object, motion.twist, time));
  }
  const std::vector<double> weights = color_weights(agreement, least);
  for (size_t i = 0; i < weights.size(); ++i) {
    poses[i].score *= weights[i];
    poses[i].rank *= weights[i];
  }
  sort_by_rank(poses);
}

}  // namespace sightline::observe
