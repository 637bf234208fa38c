// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "sightline/geometry/box3.hpp"

namespace sightline {

/// Static things that hide objects.
struct SceneConfig {
  std::vector<std::filesystem::path> meshes;
  double meters_per_unit = 1.0;
  uint64_t content = 0;        ///< hash of the files
  bool learn = false;          ///< what hides objects is learned from the cameras as well
  std::optional<Box3> volume;  ///< where objects can be, world frame

  bool operator==(const SceneConfig&) const = default;
};

}  // namespace sightline
