// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/calibrate/solve.hpp"

namespace sightline::calibrate {

struct Correlation {
  std::string a, b;  ///< "fx", "k1", "time_offset_s"; "turn x", "place z" of the camera
  double value = 0;
};

/// Pairs of what was solved for of a camera (lens, time offset, place) that the views hardly tell
/// apart: beyond 0.9, the closest first.
std::vector<Correlation> telling_correlations(const SolvedCamera& solved);

}  // namespace sightline::calibrate
