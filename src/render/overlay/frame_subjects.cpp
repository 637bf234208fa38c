// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/frame_subjects.hpp"

#include "render/overlay/tile/tile_compositor.hpp"
#include "sightline/geometry/rolling_shutter.hpp"
#include "sightline/render/mesh/level_of_detail.hpp"
#include "sightline/render/overlay/label.hpp"

namespace sightline::render {

FrameSubjects::FrameSubjects(const CalibratedCamera& camera, std::span<const OverlayObject> objects,
                             const RenderOptions& options)
    : camera_(camera),
      objects_(objects),
      options_(options),
      camera_from_world_(camera_.world_from_camera.inverse()),
      last_(objects.size()) {
  subjects_.reserve(objects.size());
}

void FrameSubjects::read(Time capture, std::span<const PoseTrackPtr> tracks,
                         std::vector<PoseAt>& poses) {
  poses.resize(objects_.size());
  subjects_.clear();
  for (size_t i = 0; i < objects_.size(); ++i) {
    read_pose(i, capture, tracks[i].get(), poses[i]);
    if (poses[i].source == PoseSource::kNone) continue;
    last_[i] = poses[i].estimate;
    insert(subject_of(i, poses[i].estimate, tracks[i].get()));
  }
}

void FrameSubjects::read_none(Time capture, std::span<const PoseTrackPtr> tracks,
                              std::vector<PoseAt>& poses) {
  poses.resize(objects_.size());
  subjects_.clear();
  for (size_t i = 0; i < objects_.size(); ++i) {
    const PoseTrack* const track = tracks[i].get();
    poses[i] = {};
    poses[i].estimate.object = objects_[i].id;
    poses[i].estimate.time = capture;
    poses[i].estimate.state =
        track != nullptr && !track->empty() ? track->newest().state : TrackState::kSearching;
  }
}

void FrameSubjects::read_pose(size_t i, Time capture, const PoseTrack* track, PoseAt& pose) {
  if (track != nullptr) {
    pose = track->at(capture);
  } else {
    pose = {};
  }
  // A pose that is no number is none.
  if (pose.source == PoseSource::kNone || !has_pose(pose.estimate.state) ||
      !pose.estimate.world_from_object.matrix().allFinite()) {
    pose.source = PoseSource::kNone;
    pose.estimate = {};
    pose.estimate.state = state_without_pose(track);
  }
  pose.estimate.object = objects_[i].id;
  pose.estimate.time = capture;
}

// Where the image shows it: a rolling shutter exposes its row sooner or later than the middle one.
Rigid3 FrameSubjects::pose_in_camera(size_t object, const PoseEstimate& estimate) const {
  const Rigid3 at_capture = camera_from_world_ * estimate.world_from_object;
  const double delay =
      row_delay_s(camera_, at_capture * objects_[object].mesh->center.cast<double>());
  return delay == 0 ? at_capture : at_capture * Rigid3::exp(estimate.twist * delay);
}

Eigen::Vector3d FrameSubjects::center_in_camera(size_t object, const PoseEstimate& estimate) const {
  return pose_in_camera(object, estimate) * objects_[object].mesh->center.cast<double>();
}

Subject FrameSubjects::subject_of(size_t i, const PoseEstimate& estimate,
                                  const PoseTrack* track) const {
  const OverlayObject& object = objects_[i];
  const OverlayStyle& style = object.style;
  Rgb hue = style.color;
  if (estimate.state == TrackState::kDegraded) hue = style.degraded_color;
  if (estimate.state == TrackState::kCoasting) hue = style.coasting_color;
  const Rigid3 camera_from_object = pose_in_camera(i, estimate);
  const Eigen::Vector3d center = camera_from_object * object.mesh->center.cast<double>();
  const RenderMesh& mesh =
      object.levels == nullptr
          ? *object.mesh
          : object.levels->choose(camera_.model, camera_from_object, options_.detail_px);
  return {i,
          &object,
          &mesh,
          &estimate,
          track,
          camera_from_object,
          center,
          {to_yuv(hue), to_yuv(style.xray_color), style.line_px,
           estimate.state == TrackState::kCoasting, style.halo_opacity},
          hide_factor(options_.depth_tolerance, options_.depth_tolerance_sigmas,
                      estimate.sigma_translation(), center.z())};
}

/// Insertion sort: few objects, stable, no allocation.
void FrameSubjects::insert(const Subject& subject) {
  const double range = subject.center.norm();
  auto at = subjects_.end();
  while (at != subjects_.begin() && range > std::prev(at)->center.norm()) --at;
  subjects_.insert(at, subject);
}

}  // namespace sightline::render
