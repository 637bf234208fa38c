// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "observe/fiducial/board_layout.hpp"
#include "observe/fiducial/square_detector.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/model/calibration_target.hpp"
#include "sightline/observe/fiducial/target_detector.hpp"

namespace sightline::observe {

/// Inner corners of a ChArUco board seen by a camera of which nothing is known: each is predicted
/// by the homography of the markers about it (a lens bends little over so short a way) and refined
/// as a saddle point.
class CharucoCorners {
 public:
  CharucoCorners(const CalibrationTarget& target, int window);

  std::vector<DetectedCorner> find(const PlaneView& gray,
                                   const std::vector<SquareDetection>& markers);
  CharucoLayout layout() const;

 private:
  const BoardLayout* choose(const std::vector<SquareDetection>& markers);

  CharucoBoard board_;
  int window_;
  std::vector<BoardLayout> layouts_;  ///< dark first, marker first (even rows)
  std::vector<int> votes_;            ///< of images, by layout
};

}  // namespace sightline::observe
