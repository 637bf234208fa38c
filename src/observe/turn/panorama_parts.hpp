// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/observe/turn/panorama.hpp"

namespace sightline::observe {

// Of the search.
constexpr int kWindow = 15;           // [px] of Lucas-Kanade
constexpr int kLevels = 3;            // beyond the full picture: 7 px of the window are 56 there
constexpr int kBorder = 4;            // [px] that are not looked at
constexpr int kMaxPoints = 150;       // of a keyframe
constexpr double kMinTexture = 3e-4;  // least eigenvalue as cv::cornerMinEigenVal() has it: slopes
                                      // of 2.2 gray levels a pixel in the weaker direction
// Of the agreement.
constexpr int kMinPoints = 12;
constexpr double kMinShare = 0.5;  // of the points that should be in the picture
constexpr int kCellsX = 6, kCellsY = 4, kMinCells = 5;
constexpr double kLeastNoise = 0.05;  // [px looked at] of a point
constexpr double kMostNoise = 1.0;
constexpr double kFloor = 0.03;  // [px looked at] that all points may be off together
constexpr double kTukey = 4.685;
// Of inverse distances about the keyframe's mean [1/m].
constexpr double kSpread = 0.5, kLeastSpread = 0.02;
constexpr int kMaxMisses = 10;  // in a row: it moves, or is gone

/// One point of the panorama, as its keyframe showed it.
struct PanoramaPoint {
  cv::Point2f at;                       ///< in the picture looked at
  Eigen::Vector3d ray;                  ///< unit, camera frame
  double depth = 0;                     ///< inverse distance less the keyframe's mean [1/m]
  double variance = kSpread * kSpread;  ///< of that
  int misses = 0;
};

/// How a keyframe's points move into a picture.
class PanoramaGeometry {
 public:
  PanoramaGeometry(const CameraModel& model, const CameraAxes& axes, const KeyframeView& view,
                   const Eigen::Vector2d& angles);
  std::optional<Eigen::Vector2d> project(const PanoramaPoint& point) const {
    return project(here_, point, 0);
  }
  /// d(pixel)/d(angles).
  std::optional<Eigen::Matrix2d> by_angles(const PanoramaPoint& point,
                                           const Eigen::Vector2d& pixel) const;
  /// d(pixel)/d(keyframe's angles).
  std::optional<Eigen::Matrix2d> by_keyframe(const PanoramaPoint& point,
                                             const Eigen::Vector2d& pixel) const;
  /// d(pixel)/d(inverse depth).
  std::optional<Eigen::Vector2d> by_depth(const PanoramaPoint& point,
                                          const Eigen::Vector2d& pixel) const;

 private:
  std::optional<Eigen::Vector2d> project(const Rigid3& here_from_keyframe,
                                         const PanoramaPoint& point, double nearer) const;
  const CameraModel& model_;
  const double depth_;
  Rigid3 here_, pan_, tilt_, keyframe_pan_, keyframe_tilt_;  ///< here from keyframe; one moved
};

}  // namespace sightline::observe
