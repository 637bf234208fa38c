// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/observe/fiducial/fiducial_observer.hpp"
#include "sightline/observe/track/object_tracker.hpp"
#include "sightline/pipeline/rig.hpp"

namespace sightline {

/// Everything that looks at one camera's frames: fiducials and the object's own look, one
/// Observation per object. One thread at a time.
class CameraObserver {
 public:
  static Result<std::unique_ptr<CameraObserver>> create(const Installation& installation,
                                                        const Rig& rig, CameraId camera);

  /// Looks at a frame with the newest tracks and appends one Observation per object that has any
  /// modality at all.
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);

  FiducialObserver& fiducials() { return *fiducials_; }
  ObjectTracker& tracker() { return *tracker_; }

 private:
  CameraObserver(std::unique_ptr<FiducialObserver> fiducials,
                 std::unique_ptr<ObjectTracker> tracker)
      : fiducials_(std::move(fiducials)), tracker_(std::move(tracker)) {}

  std::unique_ptr<FiducialObserver> fiducials_;
  std::unique_ptr<ObjectTracker> tracker_;
};

/// Puts the terms and poses of observations of one object, camera and frame into one, from index
/// `first` on; the order of the first of each stays.
void merge_observations(size_t first, std::vector<Observation>& observations);

}  // namespace sightline
