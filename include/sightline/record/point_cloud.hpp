// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>

#include "sightline/base/result.hpp"
#include "sightline/model/scene_points.hpp"

namespace sightline {

/// One point of a cloud on disk.
struct CloudPoint {
  ScenePoint point;
  Time time{};
  std::array<uint8_t, 3> rgb{};
};

/// Writes a PLY file (ASCII 1.0), one vertex a point: x y z [m, world], red green blue, kind (0
/// point, 1 edge, 2 corner), sigma (largest standard deviation over directions [m]) and t [s of the
/// recording's clock]. Replaces a file that exists. Equal points give equal bytes.
Status write_point_cloud(const std::filesystem::path& path, std::span<const CloudPoint> points);

}  // namespace sightline
