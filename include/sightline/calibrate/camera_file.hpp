// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/base/result.hpp"
#include "sightline/calibrate/opencv_camera.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// One camera from a file of either kind, as a person names it: "FILE.toml#NAME" (calibration.toml;
/// the name may be left out where the file has one camera) or "FILE" of OpenCV (YAML, XML, JSON).
/// The defaults are for OpenCV's files; calibration.toml says everything, in meters.
Result<CalibratedCamera> read_camera(const std::string& name, const CameraFileDefaults& defaults);

}  // namespace sightline
