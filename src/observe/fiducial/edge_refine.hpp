// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "observe/fiducial/square_detector.hpp"
#include "observe/terms/light_table.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// The light of white in which refine_square() has its contrast threshold.
inline constexpr double kRefineWhite = 255;

struct RefinedSquare {
  std::array<Eigen::Vector2d, 4> corners;  ///< [px]
  /// Standard deviation of a corner that the scatter of the edge points implies [px].
  double scatter_px = 0;
};

/// Corners of a square marker at full size: points on the black border's four edges by the centroid
/// of the light's gradient along the normal, straight lines through their rays (so that lens
/// distortion bends nothing), corners where neighboring lines meet. The search along the normal
/// stays within half a module, so that it never reaches into the marker's bits or its
/// surroundings. Empty if an edge is not seen along most of its length or nothing converges.
/// `light`: with kRefineWhite.
std::optional<RefinedSquare> refine_square(const PlaneView& gray, const LightTable& light,
                                           const CameraModel& camera,
                                           const std::array<Eigen::Vector2d, 4>& corners,
                                           const SquareDetector::Border& border);

}  // namespace sightline::observe
