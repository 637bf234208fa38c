// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "observe/fiducial/fiducial_object.hpp"
#include "observe/fiducial/square_detector.hpp"

namespace sightline::observe {

/// Whose marker a detector's code is.
struct CodeOwner {
  size_t object = 0;
  int fiducial = -1;  ///< index of a single marker; -1: of the board
  int board_id = -1;
};

/// One detector and the codes that it searches.
struct CodeSearch {
  std::unique_ptr<SquareDetector> detector;
  std::vector<CodeOwner> owners;  ///< by code
  std::vector<size_t> objects;    ///< sorted, unique
  int missed = 0;                 ///< searches of the whole image that missed an object
};

/// One search for all AprilTags, and one for every dictionary of ArUco markers, with the codes of
/// these objects alone. Refused: families and dictionaries that are not known, ids that are not in
/// them or stand twice.
Result<std::vector<CodeSearch>> make_code_searches(std::span<const FiducialObject> objects,
                                                   const FiducialOptions& options,
                                                   const std::string& camera);

}  // namespace sightline::observe
