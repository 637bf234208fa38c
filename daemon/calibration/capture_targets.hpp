// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/config/installation.hpp"
#include "sightline/control/http_content.hpp"
#include "sightline/model/calibration_target.hpp"

namespace sightline {

/// A target that an operator may choose for a capture, by its file's name.
struct NamedTarget {
  std::string name;  ///< "board.toml"
  CalibrationTarget target;
};

/// What can be shown to the cameras of an installation: its objects that are boards, then the
/// target files beside the installation file. What stands in the room (`fixed`) is none of them.
/// Reads the disk.
std::vector<NamedTarget> find_targets(const Installation& installation);

/// The one that is named, the one whose text was sent, or the only one there is. Refused in words
/// for a person: none, several and none named, an unknown name, a text that is no target. Reads the
/// disk.
Result<CalibrationTarget> choose_target(const CaptureOrder& order,
                                        const Installation& installation);

/// Who takes part: indices into the installation's cameras, of all where the order names none.
/// Refused: an unknown name, one that comes twice, a camera on a head that turns.
Result<std::vector<size_t>> choose_cameras(const CaptureOrder& order,
                                           const Installation& installation);

}  // namespace sightline
