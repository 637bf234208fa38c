// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/contour_belief.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/judge/search_odds.hpp"
#include "observe/detect/judge/second_to_best.hpp"

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
  const double agreement = agreement_of(contours.front(), time, colors);
  const bool tells = !indistinct(contours, colors != nullptr ? agreement : 0);
  if (tells && moved_as_one(frames, contours, where, time, found)) return found;
  found.log_odds = odds_of(contours, evidence_of(contours, time, colors));
  decide(frames, contours, where, agreement, colors != nullptr, found);
  const bool confirmed = tells && weak_.confirms(found);
  if (!tells) weak_.keep(found);
  if (found.poses.empty()) return found;
  const double score = found.poses.front().evidence;
  const bool beyond_doubt = tells && clear(found, contours, agreement, colors != nullptr);
  if (confirmed || beyond_doubt || as_told(found)) {
    weak_.clear();
    moving_.clear();
    return found;
  }
  Detection none;
  none.time = time;
  none.runner_up = score;
  return none;
}

bool ContourBelief::clear(const Detection& found, const std::vector<ContourPose>& contours,
                          double agreement, bool has_colors) const {
  if (found.log_odds >= kClearOdds) return true;
  const double score = found.poses.front().evidence;
  if (found.runner_up > kMaxContourRival * score) return false;
  if (score >= (has_colors ? kClearWithColors : kMinContourScore) && agreement >= kFewColorsAgree &&
      score - found.runner_up >= kClearContourMargin) {
    return true;
  }
  const std::vector<double>& cameras = contours.front().cameras;
  if (cameras.size() < 2 || std::ranges::min(cameras) < kMinCameraContour) return false;
  const bool colors_agree = has_colors && agreement >= kColorsAgree;
  return score >= (colors_agree ? kDistinctScoreWithColors : kMinContourScore) &&
         second_to_best(model_, contours) <= (colors_agree ? kMaxSecondWithColors : kMaxSecond);
}

bool ContourBelief::indistinct(const std::vector<ContourPose>& contours, double agreement) const {
  const bool told = contours.front().score >= kClearContourScore && agreement >= kColorsTell;
  return !told && contours.front().cameras.size() >= 2 && model_.near_rotations().empty() &&
         second_to_best(model_, contours) >= kIndistinctSecond;
}

Detection ContourBelief::believe_again(const DetectorFrames& frames,
                                       const std::vector<ContourPose>& contours, Where where,
                                       Time time, const ColorVerifier* colors) {
  Detection none;
  none.time = time;
  if (contours.empty() || promising() == nullptr) return none;
  const double rival = promising()->runner_up;
  const double agreement = agreement_of(contours.front(), time, colors);
  if (indistinct(contours, colors != nullptr ? agreement : 0)) return none;
  Detection moving = none;
  decide_moving(frames, contours, moving);
  if (moving_.continued_by(moving) && moving_.confirms(moving)) {
    weak_.clear();
    return moving;
  }
  Detection found = none;
  found.log_odds = odds_of(contours, evidence_of(contours, time, colors, rival));
  decide(frames, contours, where, agreement, colors != nullptr, found);
  found.runner_up = std::max(found.runner_up, rival);
  if (!weak_.continued_by(found)) return none;
  const bool beyond_doubt = clear(found, contours, agreement, colors != nullptr);
  if (!weak_.confirms(found) && !beyond_doubt) return none;
  weak_.clear();
  moving_.clear();
  return found;
}

bool ContourBelief::contradicts(const Detection& by_edges, const DetectorFrames& frames,
                                const std::vector<ContourPose>& contours,
                                const ColorVerifier* colors) const {
  if (by_edges.poses.empty() || contours.empty()) return false;
  const double best_agrees =
      colors != nullptr ? agreement_of(contours.front(), by_edges.time, colors) : 0;
  if (indistinct(contours, best_agrees)) return true;
  if (colors == nullptr) return false;
  const DetectedPose& pose = by_edges.poses.front();
  if (colors->correlation(pose.world_from_object, pose.twist, by_edges.time) >= kFewColorsAgree) {
    return false;
  }
  Detection alone;
  judge_.decide_by_contour(frames, contours, 0, kMaxWeakRival, alone);
  return alone.poses.empty();
}

SearchEvidence ContourBelief::evidence_of(const std::vector<ContourPose>& contours, Time time,
                                          const ColorVerifier* colors, double rival) const {
  const ContourPose& best = contours.front();
  SearchEvidence out;
  int shown = 0;
  for (size_t i = 0; i < best.cameras.size(); ++i) {
    if (best.cameras[i] < 0) continue;
    out.edge_share += best.fit.cameras[i].share();
    ++shown;
  }
  out.edge_share /= std::max(1, shown);
  out.score = best.score;
  if (best.score > 0) out.rival_share = std::max(rival, judge_.best_rival(contours)) / best.score;
  out.second_share = second_to_best(model_, contours, NearTurns::kSame);
  if (colors != nullptr) out.colors = agreement_of(best, time, colors);
  return out;
}

double ContourBelief::odds_of(const std::vector<ContourPose>& contours,
                              const SearchEvidence& evidence) {
  const auto shows = [](double contour) { return contour >= kMinCameraContour; };
  return std::ranges::count_if(contours.front().cameras, shows) >= 2 ? log_odds(evidence) : 0;
}

double ContourBelief::agreement_of(const ContourPose& pose, Time time,
                                   const ColorVerifier* colors) {
  const RigMotion& motion = pose.fit.motion;
  return colors != nullptr ? colors->correlation(motion.world_from_object, motion.twist, time) : 1;
}

// Where only what moves is looked at, nothing that stands still is a rival.
void ContourBelief::decide(const DetectorFrames& frames, const std::vector<ContourPose>& contours,
                           Where where, double agreement, bool has_colors, Detection& found) const {
  const bool rivals = where != Where::kMotion;
  const bool told_by_little = (!has_colors && !rivals) || agreement < kFewColorsAgree;
  judge_.decide_by_contour(
      frames, contours, told_by_little ? kClearContourScore : kMinWeakScore,
      agreement < kNoColorsAgree ? kMaxContourRivalWithoutColors : kMaxWeakRival, found);
  if (found.poses.empty() && !frames.show_colors()) decide_alone(frames, contours, found);
  // Where the object hardly stands out against what is behind it, neither score nor rivals reach
  // those limits.
  if (found.poses.empty() && found.log_odds >= kWeakOdds) {
    judge_.decide_by_contour(frames, contours, 0, 1, found);
  }
}

void ContourBelief::decide_moving(const DetectorFrames& frames,
                                  const std::vector<ContourPose>& contours,
                                  Detection& found) const {
  if (contours.front().rank < kMinMovingRank) return;
  judge_.decide_by_contour(frames, contours, kMinScoreAlone, kMaxWeakRival, found);
}

// What moves, whatever its colors.
bool ContourBelief::moved_as_one(const DetectorFrames& frames,
                                 const std::vector<ContourPose>& contours, Where where, Time time,
                                 Detection& out) {
  Detection found;
  found.time = time;
  decide_moving(frames, contours, found);
  // A search of everything may be taken in by what stands still.
  if (where != Where::kMotion && !moving_.continued_by(found)) return false;
  if (!moving_.confirms(found)) return false;
  weak_.clear();
  out = std::move(found);
  return true;
}

// In images without colors, whatever those of the mesh say.
void ContourBelief::decide_alone(const DetectorFrames& frames,
                                 const std::vector<ContourPose>& contours, Detection& found) const {
  judge_.decide_by_contour(frames, contours, kMinGrayScore, kMaxRivalOfAlone, found);
  if (!found.poses.empty() && found.poses.front().cameras >= 2) return;
  found.poses.clear();
  found.observations.clear();
}

}  // namespace sightline::observe
