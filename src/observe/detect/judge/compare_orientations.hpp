// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/detect/contour_search.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/judge/detection_judge.hpp"
#include "observe/detect/pose_fit.hpp"
#include "sightline/observe/detect/color_verifier.hpp"
#include "sightline/observe/detect/pose_check.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// What a detector works with, for the length of a call.
struct DetectorParts {
  const ViewpointModel& model;
  const DetectorFrames& frames;
  const PoseFitter& fitter;
  const ContourSearch& contours;
  const DetectionJudge& judge;
};

/// Compares a pose of `time`, which the frames refer to, as it is and fitted from close by, with
/// itself turned about its principal axes. `colors` null: the mesh has none.
OrientationComparison compare_orientations(const DetectorParts& parts, const RigMotion& motion,
                                           Time time, const ColorVerifier* colors);
/// Whether what a search has found about the place of a pose is that pose.
bool is_same(const ViewpointModel& model, const ContourPose& found, const Rigid3& pose);

}  // namespace sightline::observe
