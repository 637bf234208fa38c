// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/pose_term.hpp"

namespace sightline::test {

struct PointMatch {
  Eigen::Vector3d point_in_object;
  Eigen::Vector2d pixel;
};

/// Reprojection of points with Gaussian pixel noise, without robust weights: the plainest PoseTerm,
/// for tests that ask whether the statistics are right.
class ReprojectionTerm : public PoseTerm {
 public:
  ReprojectionTerm(CalibratedCamera camera, std::vector<PointMatch> matches, double sigma_px)
      : camera_(std::move(camera)), matches_(std::move(matches)), sigma_px_(sigma_px) {}
  LinearizedTerm linearize(const Rigid3& world_from_object) const override;
  std::string_view kind() const override { return "reprojection"; }

 private:
  CalibratedCamera camera_;
  std::vector<PointMatch> matches_;
  double sigma_px_;
};

/// Damped Gauss-Newton on one term; returns the pose, and its cost in `cost`.
Rigid3 minimize(const PoseTerm& term, const Rigid3& start, double* cost);

}  // namespace sightline::test
