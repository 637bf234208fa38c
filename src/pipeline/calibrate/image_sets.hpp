// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/calibrate/views.hpp"
#include "sightline/pipeline/target_views.hpp"

namespace sightline::pipeline {

/// What one image shows of the target; no corners: nothing.
struct TimedCorners {
  size_t camera = 0;
  double time_s = 0;
  std::vector<TargetCorner> corners;
};

/// How each corner moves, from the images of the same camera within 0.13 s before and after (two at
/// least, each at most `reach_s` from the next). `found` is in order of time.
void add_motion(std::vector<TimedCorners>& found, double reach_s);

/// Images of different cameras within `span_s` become sets; their time is the mean.
void group_into_sets(const std::vector<TimedCorners>& found, double span_s,
                     CalibrationViews& views);

/// Set of each file by the last number in its name, or by its order. `sets`: how many there are.
std::vector<std::vector<size_t>> sets_of_stills(const std::vector<CameraStills>& stills,
                                                size_t& sets);

}  // namespace sightline::pipeline
