// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/views.hpp"

namespace sightline {

struct TargetViewsOptions {
  int window = 0;    ///< see TargetDetectorOptions
  size_t every = 1;  ///< look at every so many images of a camera
  /// Images of different cameras belong to one set if they were taken within this time; 0: half of
  /// the shortest frame period. Corners are carried to the set's time by their own motion.
  double set_span_s = 0;
  std::vector<std::string> cameras;  ///< take part; empty: all
  bool by_any = false;               ///< enough if one camera sees the target at all
  std::function<void(size_t done, size_t total)> on_progress;
};

/// The still images of one camera.
struct CameraStills {
  std::string name;
  std::vector<std::filesystem::path> files;
};

/// Looks for the target in every image of a recording, and puts images taken together into sets.
/// Of several (CalibrationTarget::others) each has sets of its own; one that is fixed has a single
/// one, in which a camera's view is the median over its images.
/// Refused: what open_recording() refuses, unknown cameras, a target that is found nowhere (with
/// what was found instead), a ChArUco print of the other layout than the target file says.
Result<CalibrationViews> views_of_recording(const std::filesystem::path& recording,
                                            const CalibrationTarget& target,
                                            const TargetViewsOptions& options);

/// The same in stills. Images belong to one set if the last numbers in their file names agree;
/// where names have none, by their order. Refused besides: images of several sizes in one camera.
Result<CalibrationViews> views_of_stills(const std::vector<CameraStills>& stills,
                                         const CalibrationTarget& target,
                                         const TargetViewsOptions& options);

/// "NAME=FOLDER", "NAME=PATTERN" (with * and ?) or a FOLDER, whose name is then the camera's; files
/// in the order of their names.
Result<CameraStills> parse_stills(const std::string& argument);

}  // namespace sightline
