// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/stereo/smooth_plane.hpp"
#include "sightline/model/scene_points.hpp"

namespace sightline::observe {

/// A place of an image that can be found again in another one.
struct InterestPoint {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();   ///< sub-pixel
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();  ///< unit, across the edge; zero for a corner
  PointKind kind = PointKind::kCorner;
  float strength = 0;
};

struct InterestOptions {
  int max_corners = 300;
  int max_edges = 700;
  int spacing_px = 3;
  double min_gradient = 4;  ///< [levels/px]
  int border_px = 8;        ///< of the plane, that stays empty
};

/// Corners first, then edge points, each strongest first, no two closer than the spacing.
/// Corners: local maxima of the smaller eigenvalue of the structure tensor over 5x5 pixels (Shi and
/// Tomasi, "Good features to track", 1994), at least half of min_gradient^2; edge points: maxima of
/// the gradient along its own direction (Canny, 1986). Both between pixels by a parabola.
std::vector<InterestPoint> interest_points(const SmoothPlane& plane,
                                           const InterestOptions& options);

}  // namespace sightline::observe
