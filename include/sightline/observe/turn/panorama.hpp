// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

/// What is believed of a keyframe of a panorama.
struct KeyframeView {
  Eigen::Vector2d angles = Eigen::Vector2d::Zero();  ///< pan, tilt [rad] it was taken at
  double inverse_depth = 0;                          ///< mean of what it shows [1/m]
};

/// The angles of a picture as far as a keyframe tells them: true if the keyframe's view is.
struct PictureAngles {
  Eigen::Vector2d angles = Eigen::Vector2d::Zero();      ///< pan, tilt [rad]
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< of what was found in the image alone
  Eigen::Matrix2d by_keyframe = Eigen::Matrix2d::Identity();  ///< d(angles)/d(keyframe's angles)
  Eigen::Vector2d by_depth = Eigen::Vector2d::Zero();  ///< d(angles)/d(inverse depth) [rad m]
  int points = 0;                                      ///< that agree
};

/// Corners, in pixels, whose convex hull is left out: something that moves is there.
using MaskPolygon = std::vector<Eigen::Vector2d>;

/// The static surroundings of a camera that turns, as keyframes on the sphere of directions: each
/// with points of texture, their directions and what is known of their distances (inverse, about
/// the keyframe's mean: the camera is off its axes, so near things move before far ones; Civera,
/// Davison and Montiel, "Inverse depth parametrization for monocular SLAM", 2008). A picture's
/// angles come from where it shows a keyframe's points (pyramidal Lucas-Kanade from where the
/// angles put them; Bouguet, 2001) by robust least squares (Tukey's weights) over two unknowns:
/// what moves is outvoted. Keyframes stay as they are, so errors do not add up. Pictures wider than
/// 640 px are looked at at half size. Where keyframes look is told by the caller (TurnFilter). One
/// thread at a time.
class Panorama {
 public:
  static constexpr size_t kMaxKeyframes = 40;

  /// `axes` are kept; `model`: of the lens in use.
  Panorama(const CameraModel& model, const CameraAxes& axes);
  ~Panorama();

  /// The picture that measure() and add() look at from now on: `gray` is that of a frame of the
  /// camera, `half_gray` its half (used if the picture is wider than 640 px). Both must stay until
  /// the next call.
  void look_at(const PlaneView& gray, const PlaneView& half_gray,
               std::span<const MaskPolygon> masked);
  /// Whether the next look_at() wants its second argument.
  static bool wants_half(const CameraModel& model) { return model.width() > kFullWidth; }

  /// The picture's angles by keyframe `index`, searched about `start`; empty where fewer than half
  /// of its points agree, or fewer than a dozen, or too few parts of the picture. Learns distances
  /// of points.
  std::optional<PictureAngles> measure(size_t index, const KeyframeView& view,
                                       const Eigen::Vector2d& start);
  /// Makes a keyframe of the picture, in place `index` (up to size(): a new one). False: it has no
  /// texture to speak of, and nothing is kept.
  bool add(size_t index);
  size_t size() const;
  void clear();
  /// How far two directions may be apart [rad] so that one's keyframe is used for the other, and
  /// so that none is made in between.
  double reach() const;
  double spacing() const;

 private:
  static constexpr int kFullWidth = 640;
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
