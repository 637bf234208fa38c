// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/contour_belief.hpp"

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {

Detection ContourBelief::believe(const DetectorFrames& frames,
                                 const std::vector<ContourPose>& contours, Where where, Time time,
                                 const ColorVerifier* colors,
                                 const std::function<bool(const Detection&)>& as_told) {
  Detection found;
  found.time = time;
  if (contours.empty()) {
    weak_.clear();
    if (where == Where::kMotion) moving_.clear();
    return found;
  }
  const RigMotion& best = contours.front().fit.motion;
  const double agreement =
      colors != nullptr ? colors->correlation(best.world_from_object, best.twist, time) : 1;
  // Where only what moves is looked at, nothing that stands still is a rival.
  const bool rivals = where != Where::kMotion;
  const bool outline_alone = colors == nullptr && !rivals;
  const bool told_by_little = outline_alone || agreement < kFewColorsAgree;
  if (told_by_little && moved_as_one(frames, contours, where, time, found)) return found;
  judge_.decide_by_contour(
      frames, contours, told_by_little ? kClearContourScore : kMinWeakScore,
      agreement < kNoColorsAgree ? kMaxContourRivalWithoutColors : kMaxWeakRival, found);
  if (found.poses.empty() && rivals && !frames.show_colors()) decide_alone(frames, contours, found);
  const bool confirmed = weak_.confirms(found);
  if (found.poses.empty()) return found;
  const double score = found.poses.front().evidence;
  const double enough = colors != nullptr ? kClearContourScore : kMinContourScore;
  const bool clear = score >= enough && agreement >= kFewColorsAgree &&
                     found.runner_up <= kMaxContourRival * score &&
                     score - found.runner_up >= kClearContourMargin;
  if (confirmed || clear || as_told(found)) {
    weak_.clear();
    moving_.clear();
    return found;
  }
  Detection none;
  none.time = time;
  none.runner_up = score;
  return none;
}

// What moves, whatever its colors.
bool ContourBelief::moved_as_one(const DetectorFrames& frames,
                                 const std::vector<ContourPose>& contours, Where where, Time time,
                                 Detection& out) {
  Detection found;
  found.time = time;
  if (contours.front().rank >= kMinMovingRank) {
    judge_.decide_by_contour(frames, contours, kMinScoreAlone, kMaxWeakRival, found);
  }
  // A search of everything may be taken in by what stands still.
  if (where != Where::kMotion && !moving_.continued_by(found)) return false;
  if (!moving_.confirms(found)) return false;
  weak_.clear();
  out = std::move(found);
  return true;
}

// Without colors every score is low, of clutter too.
void ContourBelief::decide_alone(const DetectorFrames& frames,
                                 const std::vector<ContourPose>& contours, Detection& found) const {
  judge_.decide_by_contour(frames, contours, kMinScoreAlone, kMaxRivalOfAlone, found);
  if (!found.poses.empty() && found.poses.front().cameras >= 2) return;
  found.poses.clear();
  found.observations.clear();
}

}  // namespace sightline::observe
