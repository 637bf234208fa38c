// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// Surface normal at a point of a smooth limb, from the normal of the outline in the image plane of
/// the view: perpendicular to the line of sight. Object frame; unit.
Eigen::Vector3d limb_normal(const View& view, const ContourSample& sample);

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
  /// From a sample of a view's outline (its point, and its limb_normal()): the point of the same
  /// profile that is the limb as the camera at `camera` sees it:  (R n) . (R p - c) = 0.  Nothing
  /// if that is no small turn away, or if the normal is not one of this surface.
  struct LimbPoint {
    Eigen::Vector3d point, normal;
  };
  std::optional<LimbPoint> limb(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                                const Eigen::Vector3d& camera) const;

 private:
  static constexpr size_t kRadial = 48, kAxial = 96;  ///< cells of the profile
  RevolvedSurface(const ViewpointModel& views, const ShapeSymmetry::Axis& about);
  /// Where an outline crosses a plane across the axis: the tangent there, in radii.
  struct TangentLine {
    Eigen::Vector2d normal;  ///< unit, outwards
    double distance = 0;     ///< from the axis
    double along = 0;        ///< the axis
    size_t cell = 0;         ///< of `along`
  };
  static std::array<double, kAxial> profile_of(const std::vector<TangentLine>& lines);
  void collect(const ViewpointModel& views, const Eigen::Vector3d& e1, const Eigen::Vector3d& e2,
               std::vector<TangentLine>& lines) const;
  /// At the same height, all tangents of a surface of revolution are as far from its axis: robust
  /// least squares over axis and radii (iteratively reweighted, Gauss-Newton).
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
