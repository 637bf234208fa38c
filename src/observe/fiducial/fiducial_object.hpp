// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "observe/fiducial/board_corners.hpp"
#include "observe/fiducial/search_region.hpp"
#include "observe/fiducial/square_detector.hpp"
#include "sightline/observe/fiducial/fiducial_observer.hpp"

namespace sightline::observe {

/// Corners of a fiducial in its own frame (x right, y up), top-left first, clockwise.
std::array<Eigen::Vector2d, 4> square_corners(double size);

/// A single marker as it was measured in the frame at hand.
struct SeenFiducial {
  int fiducial = 0;                        ///< index in the object's description
  std::array<Eigen::Vector2d, 4> corners;  ///< [px]
  double sigma_px = 0;
};

/// One object with fiducials, and what the frame at hand shows of them.
struct FiducialObject {
  ObjectId id;
  ObjectDescription description;
  /// Single markers as in the description, then those of the board by their ids.
  std::vector<SquareInObject> squares;
  std::unique_ptr<BoardFinder> board;
  int since_full_search = 0;  ///< frames since the whole image was searched for it

  std::optional<Expectation> expected;
  std::vector<SeenFiducial> fiducials;
  std::vector<SquareDetection> board_markers;  ///< code = marker id
  bool seen() const { return !fiducials.empty() || !board_markers.empty(); }
};

/// Refused: sizes that are not positive, a board that cannot exist.
Result<FiducialObject> make_fiducial_object(ObservedObject object,
                                            const std::shared_ptr<const CalibratedCamera>& camera);

}  // namespace sightline::observe
