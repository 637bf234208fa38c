// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <string_view>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/pose_term.hpp"

namespace sightline {

/// A point on a projected line of the object (contour or crease) and where, across that line, the
/// image shows it.
struct LineMatch {
  Eigen::Vector3d point_in_object;  ///< [m]
  Eigen::Vector2d center;           ///< distorted pixel that offsets count from
  Eigen::Vector2d normal;           ///< unit, across the line; outwards for a contour
  /// Places along the normal [px] where the line may be, best first; the nearest one counts.
  std::array<float, 3> offset{};
  int offsets = 1;
  double sigma_px = 1.0;  ///< standard deviation of the offset
};

/// What all lines of one image may be wrong by together, one sigma each: errors that do not
/// average out over lines. 0: nothing.
struct LineError {
  double shift_px = 0;   ///< of the image, each coordinate: lens, clock, place of the camera
  double dilate_px = 0;  ///< outwards along all normals: response, blur, chroma, view spacing
  bool operator==(const LineError&) const = default;
};

/// Distances of projected points from measured lines, through the full lens model:
///     cost = min over b, o of  sum over lines of rho((n . (project(T X) - c - b) - m - o) / sigma)
///            + ||b||^2 / (2 shift^2) + o^2 / (2 dilate^2)
/// m: the nearest of the line's offsets; rho: the Huber function, as in ReprojectionTerm.
/// Eliminating b and o leaves an information that says no more than the lines know. (Point-to-line
/// error of Drummond and Cipolla, 2002; several candidates per line: Vacchetti, Lepetit, Fua,
/// 2004.)
///
/// A line that does not project at the pose costs as if it were `kUnseenError` sigmas off and does
/// not pull. Lines whose neighbors look at the same pixels are not independent:
/// `independent_share` is the share of them that is, and scales cost, information and the count of
/// residuals.
class LineTerm : public PoseTerm {
 public:
  static constexpr double kUnseenError = 10;

  /// `kind`: "region" or "edge", a string literal. `huber` in sigmas.
  LineTerm(std::string_view kind, std::shared_ptr<const CalibratedCamera> camera,
           std::vector<LineMatch> lines, double huber, const LineError& error,
           double independent_share = 1.0);

  LinearizedTerm linearize(const Rigid3& world_from_object) const override;
  std::string_view kind() const override { return kind_; }
  const std::vector<LineMatch>& lines() const { return lines_; }

 private:
  struct Residual;
  size_t project(const Rigid3& world_from_object, Residual* out, double& cost) const;

  std::string_view kind_;
  std::shared_ptr<const CalibratedCamera> camera_;
  Rigid3 camera_from_world_;
  std::vector<LineMatch> lines_;
  double huber_;
  LineError error_;
  double share_;
};

}  // namespace sightline
