// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sightline/model/object.hpp"
#include "support/scene_rig.hpp"

namespace sightline::test {

/// One of the rig's `others` that a recording knows as an object, with a path that never ends.
struct RecordedBody {
  std::string name;
  std::shared_ptr<const RayMesh> shape;
  ScenePath path;
  Symmetry symmetry = Symmetry::kNone;
};

/// Writes the rig's frames as a recording folder (losslessly, FFV1) with calibration, objects,
/// truth.csv at every true capture time, and visibility.csv; `sightline replay` takes it. The
/// folder's parent must exist, the folder must be empty or missing. Takes about 30 ms a frame.
Status write_scene_recording(const SceneRig& rig, const std::filesystem::path& folder,
                             Symmetry symmetry = Symmetry::kNone,
                             const std::vector<RecordedBody>& others = {});

}  // namespace sightline::test
