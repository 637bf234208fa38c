// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/colors/contour_colors.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

std::vector<double> color_weights(std::span<const double> agreement) {
  std::vector<double> out(agreement.size(), 1.0);
  if (agreement.empty()) return out;
  const double best = *std::max_element(agreement.begin(), agreement.end());
  if (best < kLeastColors) return out;
  for (size_t i = 0; i < out.size(); ++i) {
    const double lacks = (best - agreement[i] - kSameColors) / kOtherColors;
    out[i] -= kOtherColorsPenalty * std::clamp(lacks, 0.0, 1.0);
  }
  return out;
}

void weigh_by_colors(const ColorVerifier& colors, Time time, std::vector<ContourPose>& poses) {
  if (poses.empty()) return;
  const double least = kComparedByColors * poses.front().score;
  std::vector<double> agreement;  // of the poses that matter
  for (const ContourPose& pose : poses) {
    if (pose.score < least) break;
    const RigMotion& motion = pose.fit.motion;
    agreement.push_back(colors.correlation(motion.world_from_object, motion.twist, time));
  }
  const std::vector<double> weights = color_weights(agreement);
  for (size_t i = 0; i < weights.size(); ++i) poses[i].score *= weights[i];
  std::stable_sort(poses.begin(), poses.end(),
                   [](const ContourPose& a, const ContourPose& b) { return a.score > b.score; });
}

}  // namespace sightline::observe
