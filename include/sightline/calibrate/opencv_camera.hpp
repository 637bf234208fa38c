// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// What a camera file may leave open.
struct CameraFileDefaults {
  int width = 0, height = 0;     ///< [px], of a file that does not say; 0: then it is an error
  double meters_per_unit = 1.0;  ///< of the translations in the file
};

/// One camera as OpenCV's FileStorage writes it (YAML, XML or JSON), under the names that its
/// samples, its calibration programs and ROS use:
///
///     camera_matrix            3x3 (also cameraMatrix, K, M)
///     distortion_coefficients  4, 5 or 8 numbers, more if they are zero (also distCoeffs, D)
///     image_width, image_height  (also imageSize, image_size)
///     distortion_model         "plumb_bob", "rational_polynomial", "fisheye" or "equidistant";
///                              without it, by the count of coefficients
///     rvec, tvec               camera_from_world, as solvePnP returns them (also rotation_vector,
///                              translation_vector; R and T; rotation_matrix)
///     camera_from_world        or world_from_camera: 4x4 instead
///
/// Refused by name: what is missing, of the wrong shape or not finite, skew, a matrix that is no
/// rotation, coefficients that our lens models do not have.
Result<CalibratedCamera> read_opencv_camera(const std::filesystem::path& path,
                                            const CameraFileDefaults& defaults = {});

/// The same from memory; `where` names the file in errors.
Result<CalibratedCamera> parse_opencv_camera(const std::string& text, const std::string& where,
                                             const CameraFileDefaults& defaults = {});

}  // namespace sightline
