// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "observe/fiducial/square_detector.hpp"

namespace sightline::observe {

struct AprilTagLimits {
  int threads = 1;
  int max_hamming = 1;
  double min_decision_margin = 20;
};

/// True for a family of the AprilTag library.
bool is_apriltag_family(const std::string& family);
std::vector<std::string> apriltag_families();

/// Codes may be of several families. Refuses ids that a family does not have.
Result<std::unique_ptr<SquareDetector>> make_apriltag_detector(const std::vector<SquareCode>& codes,
                                                               const AprilTagLimits& limits,
                                                               const std::string& where);

/// Modules inside the outer edge of the black border, row by row, true for dark; a square. Empty if
/// the family does not have the id, or has data outside its border (the "circle" and "standard"
/// families), which a grid has no room for.
std::vector<bool> apriltag_modules(const std::string& family, int id);

}  // namespace sightline::observe
