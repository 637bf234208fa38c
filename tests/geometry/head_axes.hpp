// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/geometry/camera_axes.hpp"

namespace sightline::test {

/// A pan and tilt head with nothing in line.
inline CameraAxes head_axes() {
  Vector6 base, offset, camera;
  base << 0.1, -0.2, 1.1, 0.5, -1.2, 0.8;
  offset << 0.02, -0.01, 0.03, 0.004, 0.012, 0.06;
  camera << -1.5, 0.05, 0.02, 0.003, 0.035, 0.008;
  CameraAxes axes;
  axes.world_from_base = Rigid3::exp(base);
  axes.pan_from_tilt = Rigid3::exp(offset);
  axes.tilt_from_camera = Rigid3::exp(camera);
  return axes;
}

}  // namespace sightline::test
