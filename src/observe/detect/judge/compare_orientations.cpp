// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/compare_orientations.hpp"

#include <algorithm>
#include <utility>

#include "observe/detect/colors/contour_colors.hpp"
#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

OrientationComparison compare_orientations(const DetectorParts& parts, const RigMotion& motion,
                                           Time time, const ColorVerifier* colors) {
  OrientationComparison out;
  const auto& [model, frames, fitter, contours, judge] = parts;
  const Rigid3& here = motion.world_from_object;
  std::vector<ContourPose> poses = contours.compare(frames, motion, fitter.rotated(motion));
  std::erase_if(poses, [&](const ContourPose& pose) {
    const Rigid3& fitted = pose.fit.motion.world_from_object;
    return (fitted * model.center() - here * model.center()).norm() > kOtherPlace * model.radius();
  });
  const auto turned = [&](const ContourPose& pose) {
    return model.angle_up_to_symmetry(pose.fit.motion.world_from_object, here) >= kSameFittedAngle;
  };
  const ContourPose as_it_is = contours.evaluate(frames, motion);
  out.rank = out.fitted_rank = as_it_is.rank;
  const auto nearby = std::find_if_not(poses.begin(), poses.end(), turned);
  if (nearby != poses.end()) out.fitted_rank = std::max(out.fitted_rank, nearby->rank);
  if (colors != nullptr && frames.show_colors() && as_it_is.score < kClearContourScore) {
    out.shows_colors = colors->correlation(here, motion.twist, time) >= kNoColorsAgree;
  }
  if (colors != nullptr) weigh_by_colors(*colors, time, kLeastColorsOfTurns, poses);
  std::vector<ContourPose> others;
  for (ContourPose& pose : poses) {
    if (turned(pose)) {
      out.other = std::max(out.other, pose.score);
      others.push_back(std::move(pose));
    } else {
      out.here = std::max(out.here, pose.score);
    }
  }
  out.best.time = time;
  if (!others.empty()) judge.decide_by_contour(frames, others, 0, 1, out.best);
  return out;
}

bool is_same(const ViewpointModel& model, const ContourPose& found, const Rigid3& pose) {
  const Rigid3& there = found.fit.motion.world_from_object;
  return (there * model.center() - pose * model.center()).norm() < kSameOfPlace * model.radius() &&
         model.angle_up_to_symmetry(there, pose) < kSameOfPlaceAngle;
}

}  // namespace sightline::observe
