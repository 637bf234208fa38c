// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// A chessboard corner about to be refined.
struct SaddleStart {
  Eigen::Vector2d pixel;
  /// From it to points up-right.. of the board's four neighboring squares, in which they are plain:
  /// (x+, y+), (x-, y-), (x+, y-), (x-, y+) of the board [px].
  std::array<Eigen::Vector2d, 4> around;
  bool main_is_bright = false;  ///< the squares of the first two are the bright ones
  double tolerance_px = 1;      ///< how far it may move; more where squares are large
  int window = 0;               ///< half side of the window [px]; 0: from `around`
};

/// The corner as the saddle point of the image, in a window that ends before anything else begins.
/// Empty if it leaves the image or the tolerance, or if the four squares do not alternate as
/// printed (a hand or a highlight may cover them).
std::optional<Eigen::Vector2d> refine_saddle(const PlaneView& gray, const SaddleStart& start);

}  // namespace sightline::observe
