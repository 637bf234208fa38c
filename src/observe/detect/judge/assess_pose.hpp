// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/detect/contour_search.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/judge/detection_judge.hpp"
#include "observe/detect/pose_fit.hpp"
#include "observe/detect/template_bank.hpp"
#include "sightline/observe/detect/detection_trace.hpp"

namespace sightline::observe {

/// What the frames of the newest search, with their response maps, say of a pose, fitted within a
/// few pixels. Decides nothing.
PoseAssessment assess_pose(const TemplateBank& bank, const DetectorFrames& frames,
                           const PoseFitter& fitter, const ContourSearch& contours,
                           const DetectionJudge& judge, const Rigid3& world_from_object);

}  // namespace sightline::observe
