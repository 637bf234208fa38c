// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"
#include "square_detector.hpp"

namespace sightline::observe {

/// Light by grey level. An edge lies where the light changes half way; the levels of a picture are
/// a power of it, and bright areas seem to grow by a good quarter of a pixel.
using LightTable = std::array<float, 256>;
/// For luma in limited range (16..235) of a camera whose response has this exponent.
LightTable light_table(double gamma);

struct RefinedSquare {
  std::array<Eigen::Vector2d, 4> corners;  ///< [px]
  /// Standard deviation of a corner that the scatter of the edge points implies [px].
  double scatter_px = 0;
};

/// Corners of a square marker at full size: points on the black border's four edges by the centroid
/// of the grey-level gradient along the normal, straight lines through their rays (so that lens
/// distortion bends nothing), corners where neighbouring lines meet. The search along the normal
/// stays within half a module, so that it never reaches into the marker's bits or its
/// surroundings. Empty if an edge is not seen along most of its length or nothing converges.
std::optional<RefinedSquare> refine_square(const PlaneView& grey, const LightTable& light,
                                           const CameraModel& camera,
                                           const std::array<Eigen::Vector2d, 4>& corners,
                                           const SquareDetector::Border& border);

}  // namespace sightline::observe
