// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/detect/contour_search.hpp"
#include "sightline/observe/detect/color_verifier.hpp"

namespace sightline::observe {

/// Where the colors of the mesh agree with the images at one of the best poses, those at which they
/// clearly do not count for less; best first again. The colors may be anything: where they agree
/// nowhere, nothing changes. The poses are at `time`.
void weigh_by_colors(const ColorVerifier& colors, Time time, std::vector<ContourPose>& poses);

}  // namespace sightline::observe
