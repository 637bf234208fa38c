// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/pose_term.hpp"

namespace sightline {

/// A point of the object and where a camera saw it.
struct PointMatch {
  Eigen::Vector3d point_in_object;  ///< [m]
  Eigen::Vector2d pixel;            ///< distorted pixel, (0,0) = center of the top-left pixel
  double sigma_px = 0.3;            ///< standard deviation of each coordinate
};

/// What a whole view may be wrong by, one sigma each; 0: nothing. The camera's place, lens and
/// clock shift all points alike, lens and print stretch them: errors that do not average out over
/// points as their own noise does.
struct ViewError {
  double shift_px = 0;  ///< of each coordinate
  double stretch = 0;   ///< each entry of the 2x2 map of (pixel - middle of the view)
  bool operator==(const ViewError&) const = default;
};

/// Reprojection of known points of the object through the full lens model:
///     cost = min over b, A of  sum over points of rho(|| r - b - A u || / sigma)
///            + ||b||^2 / (2 shift^2) + ||A||^2 / (2 stretch^2)
///     r = project(camera_from_object * X) - x,   u = x - mean of all x
/// with the Huber function rho(e) = e^2/2 for e <= threshold, threshold (e - threshold/2) beyond.
/// Eliminating b and A (Schur complement) leaves what the points say relative to each other at
/// their own precision, and what they say together at that of the ViewError.
///
/// `information` is the Gauss-Newton matrix with the weights of iteratively re-weighted least
/// squares (Zhang, "Parameter estimation techniques", 1997, section 9.4). A point that does not
/// project at the pose (behind the camera, beyond the fold-over radius) costs as if it were
/// `kUnseenError` sigmas off and does not pull; quality counts it as an outlier.
class ReprojectionTerm : public PoseTerm {
 public:
  static constexpr double kUnseenError = 100;

  /// `huber` in sigmas. `camera` is shared with the observer that made the term. `kind`: "fiducial"
  /// or "texture", a string literal.
  ReprojectionTerm(std::shared_ptr<const CalibratedCamera> camera, std::vector<PointMatch> matches,
                   double huber, const ViewError& view_error = {},
                   std::string_view kind = "fiducial");

  LinearizedTerm linearize(const Rigid3& world_from_object) const override;
  std::string_view kind() const override { return kind_; }

  const std::vector<PointMatch>& matches() const { return matches_; }
  const CalibratedCamera& camera() const { return *camera_; }

 private:
  struct Residual;
  std::vector<Residual> project(const Rigid3& world_from_object, LinearizedTerm& out) const;

  std::shared_ptr<const CalibratedCamera> camera_;
  Rigid3 camera_from_world_;
  std::vector<PointMatch> matches_;
  double huber_;
  ViewError view_error_;
  std::string_view kind_;
  Eigen::Vector2d middle_;  ///< of the view [px]
};

}  // namespace sightline
