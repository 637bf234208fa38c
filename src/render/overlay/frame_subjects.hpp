// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "render/overlay/subject.hpp"

namespace sightline::render {

/// From tracks to what is drawn of one camera's frame: the objects that have a pose at its capture
/// time, each at the level of detail that this camera can show, ordered from far to near.
class FrameSubjects {
 public:
  /// `camera`, `objects` and `options` outlive it.
  FrameSubjects(const CalibratedCamera& camera, std::span<const OverlayObject> objects,
                const RenderOptions& options);

  /// Fills `poses`, one per object. What it gives lies there and in the tracks.
  void read(Time capture, std::span<const PoseTrackPtr> tracks, std::vector<PoseAt>& poses);

  /// The same where nobody knows where the camera looks: no object has a pose.
  void read_none(Time capture, std::span<const PoseTrackPtr> tracks, std::vector<PoseAt>& poses);
  /// The camera stands elsewhere from now on.
  void camera_moved() { camera_from_world_ = camera_.world_from_camera.inverse(); }

  /// From far to near.
  std::span<const Subject> all() const { return subjects_; }
  /// The last estimate that the object was drawn at, if it ever was.
  const std::optional<PoseEstimate>& last_drawn(size_t object) const { return last_[object]; }

  const Rigid3& camera_from_world() const { return camera_from_world_; }
  Eigen::Vector3d center_in_camera(size_t object, const PoseEstimate& estimate) const;

 private:
  void read_pose(size_t i, Time capture, const PoseTrack* track, PoseAt& pose);
  Rigid3 pose_in_camera(size_t object, const PoseEstimate& estimate) const;
  Subject subject_of(size_t i, const PoseEstimate& estimate, const PoseTrack* track) const;
  void insert(const Subject& subject);

  const CalibratedCamera& camera_;
  const std::span<const OverlayObject> objects_;
  const RenderOptions& options_;
  Rigid3 camera_from_world_;
  std::vector<Subject> subjects_;
  std::vector<std::optional<PoseEstimate>> last_;  ///< by object
};

}  // namespace sightline::render
