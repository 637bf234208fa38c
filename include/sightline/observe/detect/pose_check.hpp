// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/observe/terms/detection.hpp"

namespace sightline {

/// How a pose that is believed compares with other orientations at its place, by contours.
struct OrientationComparison {
  double here = 0;   ///< score of the pose, 0 .. 1
  double other = 0;  ///< of the best in another orientation that its shape can tell from this one
  Detection best;    ///< that one, with its observations; empty: there is none
  double rank = 0;   ///< of the pose as it is: what poses of a search are compared by, 0 .. 1
  double fitted_rank = 0;  ///< of the best in its orientation
  /// The images show the colors of its mesh there, or it has none, or its outline tells alone.
  bool shows_colors = true;
};

/// What a search about the place of a pose that is believed has found there, by contours.
struct PlaceSearch {
  bool same = false;  ///< the best of it is that pose
  double rank = 0;    ///< of the best, 0: there is none
  double second = 0;  ///< rank of the best other pose there as a share of it, 0: there is none
};

}  // namespace sightline
