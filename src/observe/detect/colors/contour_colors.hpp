// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/detect/contour_search.hpp"
#include "sightline/observe/detect/color_verifier.hpp"

namespace sightline::observe {

/// Factor on the score of each pose by how well the colors of the mesh agree with the images there
/// (correlations): where they agree at one of them, what agrees clearly less counts for less. 1 for
/// all where they agree nowhere by `least`: they may be anything.
std::vector<double> color_weights(std::span<const double> agreement, double least);

/// Where the colors of the mesh agree with the images at one of the best poses, those at which they
/// clearly do not count for less; best first again. The colors may be anything: where they agree
/// nowhere, nothing changes. The poses are at `time`.
void weigh_by_colors(const ColorVerifier& colors, Time time, double least,
                     std::vector<ContourPose>& poses);

}  // namespace sightline::observe
