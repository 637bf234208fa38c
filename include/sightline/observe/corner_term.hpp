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
  Eigen::Vector2d pixel;            ///< distorted pixel, (0,0) = centre of the top-left pixel
  double sigma_px = 0.3;            ///< standard deviation of each coordinate
};

/// Reprojection of known points of the object through the full lens model:
///     cost = sum over points of rho(|| project(camera_from_object * X) - x || / sigma)
/// with the Huber function rho(e) = e^2/2 for e <= threshold, threshold (e - threshold/2) beyond.
/// `information` is the Gauss-Newton matrix with the weights of iteratively re-weighted least
/// squares (Zhang, "Parameter estimation techniques", 1997, section 9.4). A point that does not
/// project at the pose (behind the camera, beyond the fold-over radius) costs as if it were
/// `kUnseenError` sigmas off and does not pull; quality counts it as an outlier.
class CornerTerm : public PoseTerm {
 public:
  static constexpr double kUnseenError = 100;

  /// `huber` in sigmas. `camera` is shared with the observer that made the term.
  CornerTerm(std::shared_ptr<const CalibratedCamera> camera, std::vector<PointMatch> matches,
             double huber);

  LinearizedTerm linearize(const Rigid3& world_from_object) const override;
  std::string_view kind() const override { return "fiducial"; }

  const std::vector<PointMatch>& matches() const { return matches_; }
  const CalibratedCamera& camera() const { return *camera_; }

 private:
  std::shared_ptr<const CalibratedCamera> camera_;
  Rigid3 camera_from_world_;
  std::vector<PointMatch> matches_;
  double huber_;
};

}  // namespace sightline
