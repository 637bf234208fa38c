// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "observe/fiducial/square_detector.hpp"

namespace sightline::observe {

/// True for a dictionary name as in board files, "4X4_50".
bool is_aruco_dictionary(const std::string& dictionary);
std::vector<std::string> aruco_dictionaries();
/// "aruco_4x4_50" (a family of single markers) to "4X4_50"; empty if it does not look like one.
std::string aruco_dictionary_of_family(const std::string& family);
std::string aruco_family_of_dictionary(const std::string& dictionary);

/// All codes are of one dictionary (their `family` is not read); `inverted` prints are white on
/// black. Refuses ids that the dictionary does not have.
Result<std::unique_ptr<SquareDetector>> make_aruco_detector(const std::vector<SquareCode>& codes,
                                                            const std::string& dictionary,
                                                            bool inverted,
                                                            const std::string& where);

/// Modules of a marker with its border, row by row, true for dark; a square. Empty if the
/// dictionary does not have the id.
std::vector<bool> aruco_modules(const std::string& dictionary, int id);

}  // namespace sightline::observe
