// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/camera_axes.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sightline/base/check.hpp"

namespace sightline {
namespace {

Rigid3 turn(double angle, const Eigen::Vector3d& axis) {
  return Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), Eigen::Vector3d::Zero());
}

Rigid3 pan_turn(double pan) { return turn(pan, Eigen::Vector3d::UnitZ()); }

}  // namespace

Rigid3 CameraAxes::world_from_camera(double pan, double tilt) const {
  return world_from_base * pan_turn(pan) * pan_from_tilt * turn(tilt, Eigen::Vector3d::UnitX()) *
         tilt_from_camera;
}

// What turns about an axis of a frame turns about the same axis seen from the world: the adjoint.
Eigen::Matrix<double, 6, 2> CameraAxes::jacobian(double pan) const {
  Eigen::Matrix<double, 6, 2> out;
  out.col(0) = world_from_base.adjoint().col(2);
  out.col(1) = (world_from_base * pan_turn(pan) * pan_from_tilt).adjoint().col(0);
  return out;
}

ZoomLens CameraAxes::lens_at(double setting) const {
  SL_CHECK(!zoom.empty(), "a camera without zoom table has one lens");
  const auto above =
      std::lower_bound(zoom.begin(), zoom.end(), setting,
                       [](const ZoomLens& lens, double value) { return lens.setting < value; });
  if (above == zoom.begin()) return zoom.front();
  if (above == zoom.end()) return zoom.back();
  const ZoomLens &a = *std::prev(above), &b = *above;
  const double share = (setting - a.setting) / (b.setting - a.setting);
  const auto between = [share](double from, double to) { return from + share * (to - from); };
  ZoomLens out;
  out.setting = setting;
  out.fx = between(a.fx, b.fx);
  out.fy = between(a.fy, b.fy);
  out.cx = between(a.cx, b.cx);
  out.cy = between(a.cy, b.cy);
  for (size_t i = 0; i < out.distortion.size(); ++i) {
    out.distortion[i] = between(a.distortion[i], b.distortion[i]);
  }
  // Between two settings the true curve bends away from the line by nobody knows how much: at most
  // an eighth of the second difference; a sixteenth of the step is a cautious sigma of it.
  const double bend = 4 * share * (1 - share) * std::abs(b.fx - a.fx) / (16 * out.fx);
  out.sigma = std::hypot(between(a.sigma, b.sigma), bend);
  return out;
}

}  // namespace sightline
