// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/object_points.hpp"

#include <algorithm>
#include <cmath>

#include "sightline/pipeline/mesh_depth_renderer.hpp"

namespace sightline {
namespace {

constexpr double kRoom = 1.15;  // of the region, in radii of the object
constexpr Duration kTogether = std::chrono::milliseconds(40);  // frames of one pair, at most
// A camera whose newest frame is older than the newest of all by this is not there. Longer than the
// period of a slow camera, so that pairs do not change with every frame.
constexpr Duration kFresh = std::chrono::milliseconds(250);

std::optional<Rigid3> tracked_at(const PoseTrack& track, Time time) {
  const PoseAt at = track.at(time);
  const bool measured =
      at.estimate.state == TrackState::kTracking || at.estimate.state == TrackState::kDegraded;
  if (at.source == PoseSource::kNone || !measured) return std::nullopt;
  return at.estimate.world_from_object;
}

}  // namespace

ObjectPoints::ObjectPoints(const Installation& installation, const Rig& rig) {
  SL_CHECK(rig.cameras.size() == installation.cameras.size(), "rig of another installation");
  for (const CameraConfig& camera : installation.cameras) {
    cameras_.push_back(camera.calibration);
    observing_.push_back(observes(camera.role));
  }
  newest_.resize(cameras_.size());
  for (const RigObject& object : rig.objects) {
    Object made;
    made.id = object.named.id;
    made.center = object.mesh->center.cast<double>();
    made.radius = static_cast<double>(object.mesh->radius);
    made.surface = std::make_unique<MeshDistance>(*object.triangles);
    made.outline.resize(rig.cameras.size());
    for (size_t i = 0; i < rig.cameras.size(); ++i) {
      if (!observing_[i]) continue;  // it is in no pair
      const auto& camera = rig.cameras[i];
      made.outline[i] = mesh_depth_renderer_factory(object.mesh, camera)(camera->camera().model);
    }
    objects_.push_back(std::move(made));
  }
}

void ObjectPoints::add_frame(CameraId camera, const FramePtr& frame) {
  const CameraPlacePtr& place = frame->info().place;
  const bool good = frame->info().status == FrameStatus::kGood && (!place || place->trusted());
  if (!good || !observing_.at(camera.index())) return;
  newest_[camera.index()] = frame;
  if (place) cameras_[camera.index()].world_from_camera = place->world_from_camera;
}

void ObjectPoints::let_go() { std::fill(newest_.begin(), newest_.end(), nullptr); }

void ObjectPoints::find(std::span<const PoseTrackPtr> tracks, std::vector<Found>& out) {
  choose_cameras();
  for (Object& object : objects_) {
    for (const PoseTrackPtr& track : tracks) {
      if (track && track->object() == object.id) find_pairs(object, *track, out);
    }
  }
}

void ObjectPoints::choose_cameras() {
  Time newest = Time::min();
  for (const FramePtr& frame : newest_) {
    if (frame) newest = std::max(newest, frame->info().capture);
  }
  chosen_.clear();
  chosen_cameras_.clear();
  for (size_t i = 0; i < cameras_.size(); ++i) {
    if (!newest_[i] || newest - newest_[i]->info().capture > kFresh) continue;
    chosen_.push_back(i);
    chosen_cameras_.push_back(cameras_[i]);
  }
}

void ObjectPoints::find_pairs(Object& object, const PoseTrack& track, std::vector<Found>& out) {
  if (track.empty()) return;
  const auto pose = tracked_at(track, track.newest().time);
  if (!pose) return;
  const StereoRegion region{*pose * object.center, kRoom * object.radius};
  for (const auto& [a_chosen, b_chosen] :
       stereo_pairs(chosen_cameras_, region, finder_.options())) {
    const size_t first = chosen_[a_chosen], second = chosen_[b_chosen];
    const Time a = newest_[first]->info().capture, b = newest_[second]->info().capture;
    Time& done = object.done.try_emplace({first, second}, Time::min()).first->second;
    if (std::chrono::abs(a - b) > kTogether || std::min(a, b) <= done) continue;
    done = std::max(a, b);
    find_pair(object, track, first, second, out);
  }
}

void ObjectPoints::find_pair(Object& object, const PoseTrack& track, size_t first, size_t second,
                             std::vector<Found>& out) {
  const Frame &a = *newest_[first], &b = *newest_[second];
  const auto pose_a = tracked_at(track, a.info().capture);
  const auto pose_b = tracked_at(track, b.info().capture);
  if (!pose_a || !pose_b) return;
  const bool a_later = a.info().capture >= b.info().capture;
  const Rigid3& now = a_later ? *pose_a : *pose_b;
  const CalibratedCamera camera_a = moved_with(cameras_[first], *pose_a, now);
  const CalibratedCamera camera_b = moved_with(cameras_[second], *pose_b, now);
  Found found{object.id,
              std::max(a.info().capture, b.info().capture),
              camera_bit(CameraId(static_cast<uint32_t>(first))) |
                  camera_bit(CameraId(static_cast<uint32_t>(second))),
              now,
              camera_a,
              {},
              {}};
  finder_.find({&camera_a, a.gray()}, {&camera_b, b.gray()},
               {now * object.center, kRoom * object.radius}, found.points);
  measure(object, now, first, found);
  out.push_back(std::move(found));
}

void ObjectPoints::measure(const Object& object, const Rigid3& world_from_object, size_t camera,
                           Found& found) {
  const Rigid3 camera_from_world = found.first.world_from_camera.inverse();
  const DepthTile tile = object.outline[camera]->render(camera_from_world * world_from_object);
  const Rigid3 object_from_world = world_from_object.inverse();
  for (const ScenePoint& point : found.points) {
    const auto pixel = cameras_[camera].model.project(camera_from_world * point.point_in_world);
    if (!pixel) continue;
    const int x = static_cast<int>(std::lround(pixel->x()));
    const int y = static_cast<int>(std::lround(pixel->y()));
    if (tile.at(x, y) <= 0) continue;
    found.distances.push_back(
        object.surface->nearest(object_from_world * point.point_in_world).distance);
  }
}

}  // namespace sightline
