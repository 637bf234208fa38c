// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <string>

#include "sightline/calibrate/opencv_camera.hpp"
#include "sightline/geometry/point_list.hpp"

/// What people give to `sightline superimpose`: camera files of OpenCV, and lists of points.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto camera = sightline::parse_opencv_camera(text, "fuzz");
  if (camera) (void)camera->model.project({0.1, 0.2, 1});
  const auto points = sightline::parse_points(text, "fuzz");
  if (points && points->points.size() != points->lines.size()) __builtin_trap();
  return 0;
}
