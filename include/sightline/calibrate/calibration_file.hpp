// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// The calibration of a rig, `calibration.toml`: one [[camera]] each with
///
///     name = "left"                      # unique
///     width = 640                        # [px]
///     height = 480
///     model = "brown_conrady"            # or "rational", "fisheye" (also called "equidistant")
///     fx = 612.4                         # [px]; pixel (0,0) is the center of the top-left pixel
///     fy = 611.7
///     cx = 322.8
///     cy = 236.1
///     distortion = [k1, k2, p1, p2, k3]  # up to 5, 8 or 4 numbers; fewer are zero
///     world_from_camera = [[..], [..], [..], [..]]  # 4x4 row-major, or 16 numbers [m]
///     rvec = [..], tvec = [..]           # or these: OpenCV's, that is camera_from_world [rad, m]
///     rms_px = 0.37                      # optional, of the calibration
///     time_offset_s = 0.012              # optional: images are taken later than stamped
///     readout_s = 0.025                  # optional: rolling shutter, last row after the first
///     date = 2024-05-31                  # optional, TOML date, date-time or text; not kept
///     [camera.axes]                      # of a camera that turns, instead of a pose:
///     docs/turning.md [camera.sigmas]                    # optional, checked but not kept: fx, fy,
///     cx, cy,
///                                        # distortion, rotation [rad], translation [m]
///     fx = 0.4
///
/// Unknown keys, wrong types, duplicates, missing keys and matrices that are no rotation are
/// errors with `where` = file:line:column.
Result<std::vector<CalibratedCamera>> read_calibration(const std::filesystem::path& path);

/// The same from memory; `where` names the file in errors.
Result<std::vector<CalibratedCamera>> parse_calibration(std::string_view text,
                                                        const std::string& where);

/// Text that parse_calibration() reads back to the same cameras (poses to 1e-15).
std::string format_calibration(const std::vector<CalibratedCamera>& cameras);

/// How far a camera's numbers may be off, one sigma each; they are written beside it.
struct CalibrationSigmas {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< [px]; 0: the lens was given
  std::vector<double> distortion;         ///< as many as the lens has coefficients, or none
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();     ///< of world_from_camera's tangent [rad]
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< [m]
};

/// The same with sigmas and date (YYYY-MM-DD, or empty), as solvers know them. `remark`: a comment
/// at the top, on one line.
std::string format_calibration(const std::vector<CalibratedCamera>& cameras,
                               const std::vector<CalibrationSigmas>& sigmas,
                               const std::string& date, const std::string& remark);

/// Replaces the file so that a crash leaves the old one or the new one.
Status write_calibration(const std::filesystem::path& path,
                         const std::vector<CalibratedCamera>& cameras);

/// The camera of that name, or null.
const CalibratedCamera* find_camera(const std::vector<CalibratedCamera>& cameras,
                                    std::string_view name);

}  // namespace sightline
