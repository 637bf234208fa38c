// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "observe/detect/contour_search.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/judge/detection_judge.hpp"
#include "observe/detect/judge/moving_detections.hpp"
#include "observe/detect/judge/weak_detections.hpp"
#include "sightline/observe/detect/color_verifier.hpp"
#include "sightline/observe/detect/detection_trace.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// What a search by contours has found is believed at once where it stands out by far; what stands
/// out by little, when several searches in a row have found it, or one where somebody said it is.
class ContourBelief {
 public:
  using Where = DetectorFrames::Where;

  /// Both must outlive this.
  ContourBelief(const ViewpointModel& model, const DetectionJudge& judge)
      : model_(model),
        judge_(judge),
        weak_(model.center(), model.radius()),
        moving_(model.center(), model.radius(), [&model](const Rigid3& a, const Rigid3& b) {
          return model.angle_up_to_symmetry(a, b);
        }) {}

  /// `contours`: what a search of these frames has found there, best first. `as_told`: somebody
  /// said that it is there. No pose: nothing is believed.
  Detection believe(const DetectorFrames& frames, const std::vector<ContourPose>& contours,
                    Where where, Time time, const ColorVerifier* colors,
                    const std::function<bool(const Detection&)>& as_told);
  /// The same of a look about what waits, in newer frames: its rivals elsewhere are those that it
  /// had. What is not found there goes on waiting.
  Detection believe_again(const DetectorFrames& frames, const std::vector<ContourPose>& contours,
                          Where where, Time time, const ColorVerifier* colors);
  /// Speaks against what edges alone have found: the mesh has colors that the images do not show
  /// there, and by contours another place is about as good as the best.
  bool contradicts(const Detection& by_edges, const DetectorFrames& frames,
                   const std::vector<ContourPose>& contours, const ColorVerifier* colors) const;
  /// What a search says of its best pose; `contours` must not be empty. `rival`: a score known of
  /// another place, beside those of the others.
  SearchEvidence evidence_of(const std::vector<ContourPose>& contours, Time time,
                             const ColorVerifier* colors, double rival = 0) const;
  /// log_odds(), which are those of several cameras; 0 where less than two show the best pose.
  static double odds_of(const std::vector<ContourPose>& contours, const SearchEvidence& evidence);
  /// Says so in `trace`, at its time.
  void explain(const std::vector<ContourPose>& contours, const ColorVerifier* colors,
               DetectionTrace& trace) const {
    trace.best = evidence_of(contours, trace.time, colors);
    trace.log_odds = odds_of(contours, trace.best);
  }
  void clear() {
    weak_.clear();
    moving_.clear();
  }
  /// What waits to be found again; null: nothing. Until the next believe().
  const Detection* waiting() const {
    return weak_.newest() != nullptr ? weak_.newest() : moving_.newest();
  }
  /// What is worth a look about its place at once: that, or what moves and was found once.
  const Detection* promising() const {
    return weak_.newest() != nullptr ? weak_.newest() : moving_.promising();
  }

 private:
  /// Whether `found`, the first of `contours`, is believed without a second look.
  bool clear(const Detection& found, const std::vector<ContourPose>& contours, double agreement,
             bool has_colors) const;
  /// Other poses at the place of the best are as good: nothing is known but that something is
  /// there. Of a nearly round object they may be turns of it, which are told apart later.
  /// `agreement`: of the mesh's colors with the images at the best; 0: it has none.
  bool indistinct(const std::vector<ContourPose>& contours, double agreement) const;
  static double agreement_of(const ContourPose& pose, Time time, const ColorVerifier* colors);
  void decide(const DetectorFrames& frames, const std::vector<ContourPose>& contours, Where where,
              double agreement, bool has_colors, Detection& found) const;
  void decide_moving(const DetectorFrames& frames, const std::vector<ContourPose>& contours,
                     Detection& found) const;
  bool moved_as_one(const DetectorFrames& frames, const std::vector<ContourPose>& contours,
                    Where where, Time time, Detection& out);
  void decide_alone(const DetectorFrames& frames, const std::vector<ContourPose>& contours,
                    Detection& found) const;

  const ViewpointModel& model_;
  const DetectionJudge& judge_;
  WeakDetections weak_;
  MovingDetections moving_;  ///< the same of what moves, whatever the mesh's colors say of it
};

}  // namespace sightline::observe
