// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_axes.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// Lens families, with the coefficients as OpenCV defines them.
enum class LensModel {
  kBrownConrady,  ///< k1 k2 p1 p2 k3                (5 coefficients; fewer are zero)
  kRational,      ///< k1 k2 p1 p2 k3 k4 k5 k6       (8)
  kFisheye,       ///< equidistant: k1 k2 k3 k4      (4)
};

/// Pinhole with distortion. Camera axes x right, y down, z forward; pixel (0,0) is the center of
/// the top-left pixel. Immutable; safe for any number of threads; nothing allocates.
class CameraModel {
 public:
  struct Parameters {
    LensModel lens = LensModel::kBrownConrady;
    int width = 0;                          ///< [px]
    int height = 0;                         ///< [px]
    double fx = 0, fy = 0, cx = 0, cy = 0;  ///< [px]
    std::array<double, 8> distortion{};     ///< in the order of LensModel

    bool operator==(const Parameters&) const = default;
  };

  /// Refuses sizes outside 1..32768, numbers that are not finite, coefficients the model does not
  /// have or beyond 1e12, focal lengths outside 0.01..10,000 and a principal point beyond 100
  /// longer sides of the image (docs/formats.md). `where` names the camera or the file line.
  static Result<CameraModel> create(const Parameters& parameters, const std::string& where);

  const Parameters& parameters() const { return parameters_; }
  friend bool operator==(const CameraModel& a, const CameraModel& b) {
    return a.parameters_ == b.parameters_;
  }
  int width() const { return parameters_.width; }
  int height() const { return parameters_.height; }

  /// Pixel of a point in the camera's frame [m], with d(pixel)/d(point) where asked. Empty for a
  /// point behind the camera (z <= 0; fisheye: straight behind) or beyond max_valid_radius().
  /// A pixel outside the image is returned as it is.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_in_camera,
                                         Eigen::Matrix<double, 2, 3>* jacobian = nullptr) const;

  /// Unit ray of a pixel in the camera's frame; project(unproject(p)) = p to 1e-6 px inside the
  /// image. Empty where the lens polynomial has no inverse.
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const;

  /// Radius at which the lens polynomial folds over: in normalized coordinates hypot(x/z, y/z) for
  /// pinhole lenses, the angle to the axis [rad] for fisheye. Infinite (pi for fisheye) where it
  /// never folds. The radial part alone counts: the tangential terms are small.
  double max_valid_radius() const { return max_valid_radius_; }

  /// True if the pixel lies inside the image (pixel areas, so from -0.5 to size - 0.5).
  bool contains(const Eigen::Vector2d& pixel) const;

 private:
  explicit CameraModel(const Parameters& parameters);

  Parameters parameters_;
  double max_valid_radius_;
};

/// A camera of the rig: its lens and where it stands.
struct CalibratedCamera {
  std::string name;
  CameraModel model;
  Rigid3 world_from_camera;
  double rms_px = 0.5;  ///< of its calibration; floor for measurement noise
  /// Its images are taken so much later than their stamps say [s].
  double time_offset_s = 0;
  /// How it turns; its frames say where it stood (FrameInfo::place), and world_from_camera is where
  /// it stands at angles of zero. Empty: it stands still.
  std::optional<CameraAxes> axes = {};
  /// How much later its last row is exposed than its first (rolling shutter) [s]; stamps are those
  /// of the middle row. Negative: from the bottom up. 0: all rows at once (global shutter).
  double readout_s = 0;

  bool operator==(const CalibratedCamera&) const = default;
};

}  // namespace sightline
