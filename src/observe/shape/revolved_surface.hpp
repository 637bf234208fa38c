// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// The part of a shape that turns about its axis do not move: all of a bottle, a cup but for its
/// handle. Samples of an outline belong to the view they were taken from; as points of the body
/// they move with every turn, the limb of this part does not. Object frame. Immutable; any thread.
class RevolvedSurface {
 public:
  /// Of the samples of all views; nothing if the model knows no axis, exact or near.
  static std::optional<RevolvedSurface> of(const ViewpointModel& views);

  const ShapeSymmetry::Axis& axis() const { return axis_; }
  bool contains(const Eigen::Vector3d& point) const;
  /// Direction in which a turn moves a point beside the axis; unit.
  Eigen::Vector3d tangent(const Eigen::Vector3d& point) const;
  /// A point of the limb of some view (surface normal `normal`) turned to where the same profile is
  /// the limb as the camera at `camera` sees it:  (R n) . (R p - c) = 0.  Nothing if that is no
  /// small turn, or if the normal is not one of this surface.
  struct LimbPoint {
    Eigen::Vector3d point, normal;
  };
  std::optional<LimbPoint> limb(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                                const Eigen::Vector3d& camera) const;

 private:
  static constexpr size_t kRadial = 48, kAxial = 96;  ///< cells of the profile
  RevolvedSurface(const ViewpointModel& views, const ShapeSymmetry::Axis& about);
  /// Normals of a surface of revolution meet its axis (Pottmann and Randrup, "Rotational and
  /// helical surface approximation", 1998): least squares of a . (p x n) - (a x c) . n, robust.
  void fit_axis(const ViewpointModel& views);
  void find_profile(const ViewpointModel& views);
  /// kRadial * kAxial where there is none.
  size_t cell(const Eigen::Vector3d& point) const;

  ShapeSymmetry::Axis axis_;
  Eigen::Vector3d center_;
  double radius_;
  std::vector<bool> revolved_;  ///< by cell: the surface is there all around
};

}  // namespace sightline::observe
