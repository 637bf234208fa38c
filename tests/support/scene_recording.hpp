// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "sightline/model/object.hpp"
#include "support/scene_rig.hpp"

namespace sightline::test {

/// Writes the rig's frames as a recording folder (losslessly, FFV1) with calibration, object,
/// truth.csv at every true capture time, and visibility.csv; `sightline replay` takes it. The
/// folder's parent must exist, the folder must be empty or missing. Takes about 30 ms a frame.
Status write_scene_recording(const SceneRig& rig, const std::filesystem::path& folder,
                             Symmetry symmetry = Symmetry::kNone);

}  // namespace sightline::test
