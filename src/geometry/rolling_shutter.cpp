// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/rolling_shutter.hpp"

#include <algorithm>

namespace sightline {

double row_delay_s(const CalibratedCamera& camera, const Eigen::Vector3d& point_in_camera) {
  if (camera.readout_s == 0) return 0;
  const auto pixel = camera.model.project(point_in_camera);
  if (!pixel) return 0;
  const double height = camera.model.height();
  const double row = std::clamp(pixel->y(), -0.5, height - 0.5);
  return camera.readout_s * (row - 0.5 * (height - 1)) / height;
}

}  // namespace sightline
