// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/observation.hpp"

namespace sightline {

/// A camera that detectors may use.
struct DetectorCamera {
  CameraId id;
  CalibratedCamera calibration;
};

/// A pose that was found, at the time of the detection.
struct DetectedPose {
  Rigid3 world_from_object;
  Vector6 twist = Vector6::Zero();  ///< [rad/s, m/s], body frame; zero for cameras that expose
                                    ///< together
  double evidence = 0;              ///< sum over cameras
  int cameras = 0;                  ///< that show the object there
};

/// The result of one detection.
struct Detection {
  Time time{};  ///< capture of the camera that was searched
  /// Accepted poses, best first; empty: not found. More than one: the images show them equally
  /// well, and nothing decides between them.
  std::vector<DetectedPose> poses;
  /// One per camera that shows the object at the best pose, at that camera's own capture time, in
  /// order of time. Each has a term of kind "detection" and all poses as hypotheses.
  std::vector<Observation> observations;
  double runner_up = 0;  ///< evidence of the best pose that was not accepted
  /// The local contrast of its outline speaks for it, so that the mesh's colors cannot refuse it.
  bool by_contour = false;
  /// Score of the best pose by that, 0..1, as it was found; it is the evidence where nothing else
  /// speaks for it.
  double contour_score = 0;
  double log_odds = 0;  ///< that the best pose is right, by this search alone; by contours only
};

}  // namespace sightline
