// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "calibrate/axes/head_problem.hpp"
#include "sightline/base/result.hpp"

namespace sightline::calibrate {

/// Pose of a body in one image through a lens: of its part with most corners, then of all.
struct BodyPose {
  Rigid3 camera_from_body;
  double rms_px = 0;
};
std::optional<BodyPose> body_pose(const SightedBody& body, const BodySight& sight, LensModel lens,
                                  const LensVector& values);

/// Where the head is to be looked for: poses of bodies by setting at rest. Fills in the model's
/// axes, scales and bodies, in a world whose frame is the first body's; `poses` by view and sight.
/// Refused: no body that was seen while both axes turned, bodies that nothing ties to the others.
Status start_from_nothing(HeadProblem& problem, bool hold_scales);

/// Lens of the views of one zoom setting: that of `given`, or another that fits them clearly
/// better.
LensVector start_lens(const HeadSights& sights, const std::vector<const HeadSetting*>& settings,
                      LensModel lens, const LensVector& given);

/// The latency that fits the settings in motion best, the rest of the model given, and the curve of
/// the fit. Empty where they say nothing.
std::optional<double> start_latency(const HeadProblem& problem, LatencyCurve& curve);

}  // namespace sightline::calibrate
