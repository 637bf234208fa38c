// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "observe/stereo/smooth_plane.hpp"
#include "observe/terms/camera_view.hpp"
#include "sightline/observe/stereo/stereo_points.hpp"

namespace sightline::observe {

/// One of the two views and its smoothed image.
struct MatchView : CameraView {
  MatchView(const CalibratedCamera& calibrated, const SmoothPlane& smoothed)
      : CameraView(calibrated), plane(&smoothed) {}
  const SmoothPlane* plane;
};

/// Where a patch of one view was found in another.
struct EpipolarMatch {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< in the second view
  double score = 0;                                 ///< normalized correlation
  double runner_up = 0;  ///< the same at the best other place; -1: there is none
  double sigma_px = 0;   ///< along the curve, from noise and texture
};

/// Searches a patch of the first view along its epipolar curve in the second.
class EpipolarMatcher {
 public:
  /// The views must outlive the matcher.
  EpipolarMatcher(const MatchView& first, const MatchView& second, const StereoRegion& region,
                  const StereoPointOptions& options);

  /// Empty if the ray misses the region or the curve leaves the second image. `tilted`: planes at
  /// several angles are tried, else the one that faces both cameras.
  std::optional<EpipolarMatch> match(const Eigen::Vector2d& pixel, bool tilted);

  /// Unit direction in the first image in which the pixel moves as its match's depth changes the
  /// other way around: the epipolar direction there. Zero where there is none.
  Eigen::Vector2d epipolar_direction(const Eigen::Vector2d& pixel) const;

 private:
  struct Ray;
  struct Candidate;
  struct CurveScan;
  std::optional<Ray> ray_of(const Eigen::Vector2d& pixel) const;
  std::optional<Eigen::Vector2d> second_pixel(const Ray& ray, double inverse_depth) const;
  bool warp(const Ray& ray, double inverse_depth, const Eigen::Vector3d& normal,
            Eigen::Vector2d& pixel, Eigen::Matrix2d& map) const;
  bool sample(const Ray& ray, double inverse_depth, const Eigen::Vector3d& normal,
              std::vector<float>& patch) const;
  double score(const Ray& ray, double inverse_depth, const Eigen::Vector3d& normal);
  bool take_reference(const Eigen::Vector2d& pixel);
  std::optional<CurveScan> scan(const Ray& ray, const Eigen::Vector3d& normal);
  double climb(const Ray& ray, const Eigen::Vector3d& normal, double step, Candidate& candidate);
  Eigen::Vector3d tilt_plane(const Ray& ray, Eigen::Vector3d normal, double step,
                             Candidate& candidate);
  double refine(const Ray& ray, const Eigen::Vector3d& normal, double step, Candidate& candidate);

  MatchView first_, second_;
  StereoRegion region_;
  StereoPointOptions options_;
  Eigen::Vector3d first_center_, second_center_;
  float reference_contrast_ = 0;
  std::vector<float> reference_;                // patch of the first view, normalized
  std::vector<float> warped_, ahead_, behind_;  // of the second, at and beside a candidate
  std::vector<double> scores_;                  // along the curve
};

}  // namespace sightline::observe
