// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/object.hpp"
#include "sightline/model/observation.hpp"
#include "support/synthetic_motion.hpp"

namespace sightline::test {

/// A time during which one camera (or all, camera = -1) does not see the object.
struct Occlusion {
  int camera = -1;
  Duration from{0};
  Duration to{0};
};

/// A time during which one camera measures a wrong pose: world_from_object * error.
struct WrongPose {
  int camera = 0;
  Duration from{0};
  Duration to{0};
  Rigid3 error;
};

/// Everything about a made-up installation. Cameras stand on an arc around the world's Z axis and
/// look at its origin.
struct RigOptions {
  int cameras = 4;
  double arc = 4.71238898;  ///< [rad] between first and last camera
  double distance = 0.7;    ///< [m] from the origin
  double elevation = 0.5;   ///< [rad] above the horizon
  CameraModel::Parameters lens{LensModel::kBrownConrady,           640, 480, 600, 600, 319.5, 239.5,
                               {-0.12, 0.05, 0.0008, -0.0005, 0.0}};

  double rate_hz = 30;
  /// Start of each camera's frames as a share of the period; empty: spread evenly (free-running).
  std::vector<double> phases;
  double period_jitter = 0.0;   ///< [s] sigma of the true capture time around the grid
  Duration capture_error{0};    ///< stamps are off by up to this (uniform), and say so
  std::vector<Duration> skews;  ///< unknown constant error of each camera's stamps
  double stamp_jitter = 0.0;    ///< [s] sigma of every stamp's error, which nobody knows of
  Duration delay{0};            ///< capture to arrival
  double late_share = 0.0;      ///< of the observations that arrive late_by later
  Duration late_by{0};

  std::vector<Fiducial> fiducials;  ///< empty: a tag of `tag_size` on each face of a cube
  double cube_size = 0.08;          ///< [m]
  double tag_size = 0.06;           ///< [m]
  double min_cosine = 0.25;         ///< of the angle between a tag's normal and the view
  double pixel_sigma = 0.3;         ///< [px] of every corner's coordinates
  double claimed_pixel_sigma = 0;   ///< [px] what the terms believe; 0: the truth

  /// Every camera stands elsewhere than its calibration says: by so much in a random direction.
  double place_error = 0;      ///< [m]
  double direction_error = 0;  ///< [rad]
  /// By camera, may be shorter: it stands at world_from_camera * exp(moved) (rotation,
  /// translation).
  std::vector<Vector6> moved;
  /// The same of the calibration: it says world_from_camera * exp(recalibrated).
  std::vector<Vector6> recalibrated;

  double dropout = 0.0;  ///< share of frames that see nothing
  std::vector<Occlusion> occlusions;
  std::vector<WrongPose> wrong_poses;

  MotionOptions motion;
  Duration duration = std::chrono::seconds(2);
  uint64_t seed = 1;
};

/// What one camera's frame came to.
struct RigFrame {
  int camera = 0;
  Time true_capture{};  ///< when the image was taken; the observation has the stamp
  Time arrival{};
  bool visible = false;
  Observation observation;
};

class SyntheticRig {
 public:
  explicit SyntheticRig(const RigOptions& options);

  const RigOptions& options() const { return options_; }
  const std::vector<CalibratedCamera>& cameras() const { return cameras_; }
  const std::vector<Fiducial>& fiducials() const { return fiducials_; }
  Rigid3 truth(Time time) const { return motion_.pose(time); }
  Vector6 truth_twist(Time time) const { return motion_.twist(time); }

  /// All frames in order of arrival (ties: capture, camera).
  const std::vector<RigFrame>& frames() const { return frames_; }
  /// The same, frames of one stamp and arrival together: what a caller passes to the estimator.
  std::vector<std::vector<Observation>> sets() const;

 private:
  void place_cameras();
  void make_frames();
  void observe(RigFrame& frame, uint64_t seed) const;
  bool hidden(int camera, Time time) const;

  RigOptions options_;
  SyntheticMotion motion_;
  std::vector<CalibratedCamera> cameras_;       ///< as calibrated
  std::vector<CalibratedCamera> true_cameras_;  ///< as they stand
  std::vector<Fiducial> fiducials_;
  std::vector<RigFrame> frames_;
};

/// A cube of edge `size` with a tag on every face.
std::vector<Fiducial> cube_of_tags(double size, double tag_size);
/// Corners of a fiducial in the object's frame.
std::vector<Eigen::Vector3d> corners_in_object(const Fiducial& fiducial);

}  // namespace sightline::test
