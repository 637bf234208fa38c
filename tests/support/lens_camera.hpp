// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/geometry/camera_model.hpp"

namespace sightline::test {

/// 640x480 pixels, 54 degrees across, with a barrel distortion and its center off the middle.
inline CalibratedCamera lens_camera() {
  CameraModel::Parameters p;
  p.width = 640;
  p.height = 480;
  p.fx = p.fy = 620;
  p.cx = 318;
  p.cy = 243;
  p.distortion = {-0.12, 0.09, 0.0004, -0.0003, -0.02};
  return {"test", CameraModel::create(p, "test").value(), {}};
}

}  // namespace sightline::test
