// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "observe/fiducial/square_detector.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/observe/fiducial/fiducial_observer.hpp"

namespace sightline::observe {

/// What an object's track says of one frame.
struct Expectation {
  Rigid3 world_from_object;
  bool confident = false;  ///< state tracking: an empty region means hidden, not lost
  Region region;           ///< where its fiducials should be; empty: outside the image
  /// Of its markers that face the camera and are large enough to be believed; 0: there is none.
  double smallest_side_px = 0;
};

/// A marker as a region needs it: its corners in the object's frame, top-left first, clockwise as
/// seen from the front.
using SquareInObject = std::array<Eigen::Vector3d, 4>;

/// Empty if the track has no pose at `time` or the pose cannot be projected.
std::optional<Expectation> expect(const PoseTrack* track, Time time, const CalibratedCamera& camera,
                                  const std::vector<SquareInObject>& squares,
                                  const FiducialOptions& options);

/// The whole image.
Region whole_image(const CameraModel& camera);

}  // namespace sightline::observe
