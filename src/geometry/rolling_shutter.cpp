// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/rolling_shutter.hpp"

#include <algorithm>

namespace sightline {

double row_delay_s(const CalibratedCamera& camera, double row) {
  const double height = camera.model.height();
  const double inside = std::clamp(row, -0.5, height - 0.5);
  return camera.readout_s * (inside - 0.5 * (height - 1)) / height;
}

double row_delay_s(const CalibratedCamera& camera, const Eigen::Vector3d& point_in_camera) {
  if (camera.readout_s == 0) return 0;
  const auto pixel = camera.model.project(point_in_camera);
  return pixel ? row_delay_s(camera, pixel->y()) : 0;
}

}  // namespace sightline
