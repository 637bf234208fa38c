// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/detect/detection_policy.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"

namespace sightline {

using namespace observe;

namespace {

// Mean over the cameras that see the best pose; 0 without colors.
double mean_correlation(const ColorVerifier* colors, const Detection& detection) {
  if (colors == nullptr || detection.observations.empty()) return 0;
  double sum = 0;
  for (const Observation& observation : detection.observations) {
    sum += colors->correlation(observation, observation.hypotheses.front().world_from_object);
  }
  return sum / static_cast<double>(detection.observations.size());
}

// The cost of each symmetric pose over that of the detected one, by the same matches.
void compare_matches(const ShapeSymmetry& shape_symmetry, Detection& detection) {
  if (detection.poses.size() != 1 || shape_symmetry.rotations.empty()) return;
  for (Observation& observation : detection.observations) {
    const PoseTerm& term = *observation.terms.front();
    const Rigid3 pose = observation.hypotheses.front().world_from_object;
    const LinearizedTerm at = term.linearize(pose);
    const double max = kMaxCostOfMatch * at.residuals / 2;
    observation.symmetric_hypotheses = {{pose, 0}};
    for (const Rigid3& turn : shape_symmetry.rotations) {
      const double cost = term.linearize(pose * turn).cost - at.cost;
      observation.symmetric_hypotheses.push_back({pose * turn, std::clamp(cost, 0.0, max)});
    }
  }
}

}  // namespace

DetectorOptions DetectionPolicy::detector_options(DetectorOptions options, bool has_colors) {
  if (has_colors) options.accept *= kEvidenceWithColors;
  return options;
}

Detection DetectionPolicy::by_outline(Detection detection, const ColorVerifier* colors) const {
  if (colors != nullptr) {
    colors->resolve(detection);
    colors->compare(shape_symmetry_, detection);
  }
  if (detection.poses.empty()) return detection;
  const double agreement = mean_correlation(colors, detection);
  if (printed_ && colors != nullptr && agreement < kPrintAgrees) return {};
  if (detection.by_contour || agreement >= kColorsAgree) return detection;
  const double needed = kEvidenceWithoutColors * accept_;
  return detection.poses.front().evidence >= needed ? detection : Detection();
}

PoseProposals DetectionPolicy::confirm(PoseProposals proposals, const ColorVerifier* colors) const {
  if (!printed_ || colors == nullptr) return proposals;
  for (ProposedPose& pose : proposals.poses) {
    const double agreement =
        colors->correlation(pose.world_from_object, pose.twist, proposals.time);
    pose.confirmed = agreement >= kPrintConfirms || pose.matches >= kMatchesConfirm;
  }
  return proposals;
}

Detection DetectionPolicy::by_features(Detection detection, const ColorVerifier* colors) const {
  if (colors != nullptr) colors->resolve(detection);
  compare_matches(shape_symmetry_, detection);
  return detection;
}

}  // namespace sightline
