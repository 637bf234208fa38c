// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline::pipeline {

/// Lets everything that looks at the images of one camera believe that all its rows are exposed at
/// once, though its shutter rolls: for each frame and object time is shifted by the delay of the
/// row that shows the object's center. What was measured then is said of the frame's own time, by
/// the motion between the two as the track has it. (What rows above and below show sooner and
/// later than the center's, trackers take off: PlacedOutline::rolled_px().) One thread at a time.
class RollingView {
 public:
  /// `centers` of the objects [m, object frame], by ObjectId.
  RollingView(CalibratedCamera camera, std::vector<Eigen::Vector3d> centers);

  /// A frame: shifts the tracks.
  void look(const FrameInfo& info, std::span<const PoseTrackPtr> tracks);
  /// At the time of the frame each says where its object was when its row was exposed.
  std::span<const PoseTrackPtr> tracks() const { return tracks_; }
  /// Brings what was observed in the frame to the frame's own time.
  void bring_back(std::span<Observation> observations) const;

 private:
  /// Of an object's pose, from the time of the frame to that of its row.
  struct Motion {
    ObjectId object;
    Rigid3 moved;
  };
  Duration delay_of(ObjectId object, const PoseEstimate& estimate) const;

  CalibratedCamera camera_;
  const std::vector<Eigen::Vector3d> centers_;
  std::vector<PoseTrackPtr> tracks_;
  std::vector<Motion> motions_;
};

}  // namespace sightline::pipeline
