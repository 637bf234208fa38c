// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/calibrate/interchange.hpp"

namespace sightline::calibrate {

using Cameras = std::vector<CalibratedCamera>;
using Files = std::vector<NamedText>;

Result<Files> export_kalibr(const Cameras& cameras);
Result<Cameras> import_kalibr(const Files& files);
Result<Files> export_ros(const Cameras& cameras);
Result<Cameras> import_ros(const Files& files);
Result<Files> export_colmap(const Cameras& cameras);
Result<Cameras> import_colmap(const Files& files);
Result<Files> export_mrcal(const Cameras& cameras);
Result<Cameras> import_mrcal(const Files& files);
Result<Files> export_anipose(const Cameras& cameras);
Result<Files> export_caliscope(const Cameras& cameras);
Result<Cameras> import_anipose(const Files& files);  ///< of both
Result<Files> export_opencv(const Cameras& cameras);
Result<Cameras> import_opencv(const Files& files);

/// "[1, 2.5]" with every digit that counts.
std::string numbers(const std::vector<double>& values);

/// Angle-axis vector of a rotation.
Eigen::Vector3d rotation_vector(const Rigid3& pose);

/// A camera's numbers without trailing zeros, at least `least`, at most `most`; an error that names
/// the camera and the format where there are more.
Result<std::vector<double>> coefficients(const CalibratedCamera& camera, size_t least, size_t most,
                                         const char* format);

}  // namespace sightline::calibrate
