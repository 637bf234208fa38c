// SPDX-License-Identifier: Apache-2.0
#include "pipeline/search/found_frames.hpp"

#include <algorithm>
#include <utility>

namespace sightline::pipeline {
namespace {

constexpr double kSameRotation = 0.2;  // [rad]
constexpr double kSamePlace = 0.3;     // [radii]

bool clear(const Detection& found, const ViewpointModel& model) {
  const Rigid3& best = found.poses.front().world_from_object;
  return std::ranges::all_of(found.poses, [&](const DetectedPose& other) {
    const Rigid3& pose = other.world_from_object;
    return model.angle_up_to_symmetry(best, pose) < kSameRotation &&
           (best * model.center() - pose * model.center()).norm() < kSamePlace * model.radius();
  });
}

}  // namespace

FoundFrames::FoundFrames(std::span<const DetectorCamera> cameras, std::shared_ptr<FoundViews> views)
    : views_(std::move(views)) {
  for (const DetectorCamera& camera : cameras) {
    if (camera.id.index() >= cameras_.size()) cameras_.resize(camera.id.index() + 1);
    cameras_[camera.id.index()].camera_from_world = camera.calibration.world_from_camera.inverse();
  }
}

void FoundFrames::keep(CameraId camera, const Frame& frame) {
  if (camera.index() >= cameras_.size()) return;
  const FrameInfo& info = frame.info();
  Camera& of = cameras_[camera.index()];
  const bool fits =
      of.newest && of.newest->info().width == info.width && of.newest->info().height == info.height;
  constexpr size_t kImages = 4;  // here, offered, with the tracker, and a new one
  if (!fits) of.pool = std::make_shared<ImagePool>(info.width, info.height, kImages);
  of.newest = frame.copy_for(camera, of.pool);
}

void FoundFrames::offer(const Detection& found, const ViewpointModel& model, bool refutes) {
  if (found.poses.empty() || !clear(found, model)) return;
  for (const Observation& observation : found.observations) {
    const size_t index = observation.camera.index();
    if (index >= cameras_.size() || observation.hypotheses.empty()) continue;
    const Camera& camera = cameras_[index];
    if (!camera.newest || camera.newest->info().capture != observation.capture) continue;
    const CameraPlacePtr& place = camera.newest->info().place;
    const Rigid3 camera_from_world =
        place ? place->world_from_camera.inverse() : camera.camera_from_world;
    views_->put(observation.camera,
                {observation.object, camera.newest,
                 camera_from_world * observation.hypotheses.front().world_from_object, refutes});
  }
}

}  // namespace sightline::pipeline
