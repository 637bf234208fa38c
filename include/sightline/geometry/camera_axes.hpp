// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// The lens at one setting of a zoom.
struct ZoomLens {
  double setting = 0;                     ///< as the encoder says
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< [px]
  std::array<double, 8> distortion{};     ///< in the order of the camera's LensModel
  double sigma = 0;                       ///< of fx and fy, as a share of them

  bool operator==(const ZoomLens&) const = default;
};

/// How a camera on a pan and tilt head stands, as a function of its angles:
///     world_from_camera = world_from_base * pan * pan_from_tilt * tilt * tilt_from_camera
/// Pan turns about the z axis of the base, tilt about the x axis of the tilt frame: with x to the
/// right, y ahead and z up, positive angles look to the left and up. And what is known of the
/// readings of these angles. Angles [rad]; immutable numbers; any thread.
struct CameraAxes {
  Rigid3 world_from_base, pan_from_tilt, tilt_from_camera;
  double pan_scale = 1, tilt_scale = 1;  ///< of the readings; -1: the device counts the other way
  double latency_s = 0;        ///< a reading is true of so long before its stamp, 0 .. 0.5
  double latency_sigma_s = 0;  ///< one sigma of that
  double sigma = 2e-4;         ///< of a reading, with its rounding
  double backlash = 0;         ///< play between axis and encoder: the whole gap
  double max_rate = 6;         ///< [rad/s]; what turns faster is no turn but a fault
  double acceleration = 5;     ///< usual largest [rad/s^2]: what is not measured may change so
  double stale_s = 0.15;       ///< angles that are extrapolated further are not believed
  std::vector<ZoomLens> zoom;  ///< by growing setting, two or more; empty: the lens is fixed

  bool operator==(const CameraAxes&) const = default;

  Rigid3 world_from_camera(double pan, double tilt) const;
  /// d(world_from_camera)/d(pan, tilt), of a tangent on the left (world axes): exp(J d) * pose.
  Eigen::Matrix<double, 6, 2> jacobian(double pan) const;
  /// The lens at a setting: linear between the settings of the table, the end's beyond it; sigma
  /// grows by a sixteenth of the step halfway. The table must not be empty.
  ZoomLens lens_at(double setting) const;
};

}  // namespace sightline
