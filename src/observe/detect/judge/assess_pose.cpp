// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/assess_pose.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/joint_search.hpp"

namespace sightline::observe {

PoseAssessment assess_pose(const TemplateBank& bank, const DetectorFrames& frames,
                           const PoseFitter& fitter, const ContourSearch& contours,
                           const DetectionJudge& judge, const Rigid3& world_from_object) {
  PoseAssessment out;
  const Executor serially = run_serially;  // JointSearch refers to it
  const JointSearch joint(bank, frames.search_cameras(), serially);
  const PoseFit fit =
      fitter.fit(frames.fit_cameras(), {world_from_object, Vector6::Zero()}, kFinalReach);
  int cameras = 0;
  for (size_t i = 0; i < frames.size(); ++i) {
    const double spread = joint.camera_score(i, world_from_object, JointSearch::Spread::kFar);
    if (spread < 0) continue;
    ++cameras;
    out.spread_response += spread;
    out.sharp_response += joint.camera_score(i, world_from_object, JointSearch::Spread::kNear);
    out.edge_share += fit.cameras[i].share();
    out.contrast += fit.cameras[i].contrast;
  }
  for (double* sum : {&out.spread_response, &out.sharp_response, &out.edge_share, &out.contrast}) {
    *sum /= std::max(1, cameras);
  }
  out.contour = contours.evaluate(frames, fit.motion).score;
  out.evidence = judge.judge(fit).evidence;
  return out;
}

}  // namespace sightline::observe
