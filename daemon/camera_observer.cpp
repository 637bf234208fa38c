// SPDX-License-Identifier: Apache-2.0
#include "camera_observer.hpp"

#include <algorithm>
#include <iterator>

#include "mesh_depth_renderer.hpp"

namespace sightline {
namespace {

std::vector<TrackedObject> tracked_objects(const Rig& rig) {
  std::vector<TrackedObject> objects;
  for (const RigObject& object : rig.objects) {
    if (!object.views) continue;
    objects.push_back({object.named.id, object.views, object.description.cues,
                       mesh_depth_renderer_factory(object.mesh), object.lookalikes, object.spots});
  }
  return objects;
}

}  // namespace

Result<std::unique_ptr<CameraObserver>> CameraObserver::create(const Installation& installation,
                                                               const Rig& rig, CameraId camera) {
  SL_ASSIGN(auto fiducials, make_observer(installation, rig, camera));
  std::vector<TrackedObject> objects = tracked_objects(rig);
  SceneDepth scene;
  if (!objects.empty()) scene = make_scene_depth(installation, rig, camera);
  SL_CHECK(camera.index() < installation.cameras.size(), "camera id of another installation");
  const CameraConfig& config = installation.cameras[camera.index()];
  TrackerOptions options = installation.tracker;
  if (config.gamma > 0) options.gamma = config.gamma;
  SL_ASSIGN(auto tracker, ObjectTracker::create(config.calibration, camera, std::move(objects),
                                                options, std::move(scene)));
  return std::unique_ptr<CameraObserver>(
      new CameraObserver(std::move(fiducials), std::move(tracker)));
}

void CameraObserver::step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
                          std::vector<Observation>& out) {
  const size_t first = out.size();
  fiducials_->step(frame, tracks, out);
  tracker_->step(frame, tracks, out);
  merge_observations(first, out);
}

void merge_observations(size_t first, std::vector<Observation>& observations) {
  for (size_t i = first; i < observations.size(); ++i) {
    Observation& kept = observations[i];
    for (size_t j = observations.size() - 1; j > i; --j) {
      Observation& other = observations[j];
      if (other.object != kept.object) continue;
      std::move(other.terms.begin(), other.terms.end(), std::back_inserter(kept.terms));
      std::move(other.hypotheses.begin(), other.hypotheses.end(),
                std::back_inserter(kept.hypotheses));
      observations.erase(observations.begin() + static_cast<ptrdiff_t>(j));
    }
  }
}

}  // namespace sightline
