// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "observe/detect/contour_search.hpp"
#include "observe/detect/detector_frames.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

struct LoggedSearch {
  ObjectId object;
  std::string_view what;
  DetectorFrames::Where where;
};

/// One line at level debug, for those who ask why an object is not found. `contours`: best first;
/// `out`: what is believed; `waiting`: what is not yet (null: nothing).
void log_search(const LoggedSearch& search, const ViewpointModel& model,
                const std::vector<ContourPose>& contours, const Detection& out,
                const Detection* waiting);

}  // namespace sightline::observe
