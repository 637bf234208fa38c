// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/observe/fiducial/fiducial_observer.hpp"
#include "sightline/observe/track/object_tracker.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/pipeline/search/found_views.hpp"

namespace sightline {

namespace pipeline {
class RollingView;
class TurningView;
}  // namespace pipeline

/// Everything that looks at one camera's frames: fiducials and the object's own look, one
/// Observation per object. One thread at a time.
class CameraObserver {
 public:
  static Result<std::unique_ptr<CameraObserver>> create(const Installation& installation,
                                                        const Rig& rig, CameraId camera);
  ~CameraObserver();

  /// What a search puts there of this camera is taken at each step().
  void take_from(std::shared_ptr<FoundViews> found) { found_ = std::move(found); }
  /// Looks at a frame with the newest tracks and appends one Observation per object that has any
  /// modality at all. Of a camera that turns, what it says is what the camera would say at the
  /// frame's place; where that is not known it says nothing. Of one whose shutter rolls, it is said
  /// of the frame's capture time.
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);

  FiducialObserver& fiducials() { return *fiducials_; }
  ObjectTracker& tracker() { return *tracker_; }

 private:
  CameraObserver(CameraId camera, std::unique_ptr<FiducialObserver> fiducials,
                 std::unique_ptr<ObjectTracker> tracker,
                 std::unique_ptr<pipeline::TurningView> turning,
                 std::unique_ptr<pipeline::RollingView> rolling);

  const CameraId camera_;
  std::shared_ptr<FoundViews> found_;  // null: nobody searches
  std::unique_ptr<FiducialObserver> fiducials_;
  std::unique_ptr<ObjectTracker> tracker_;
  std::unique_ptr<pipeline::TurningView> turning_;  // null: the camera stands still
  std::unique_ptr<pipeline::RollingView> rolling_;  // null: all rows are exposed at once
};

/// Puts the terms and poses of observations of one object, camera and frame into one, from index
/// `first` on; the order of the first of each stays.
void merge_observations(size_t first, std::vector<Observation>& observations);

}  // namespace sightline
