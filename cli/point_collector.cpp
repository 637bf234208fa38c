// SPDX-License-Identifier: Apache-2.0
#include "point_collector.hpp"

#include <algorithm>
#include <cmath>

#include "mesh_depth_renderer.hpp"

namespace sightline::cli {
namespace {

constexpr double kRoom = 1.15;  // of the region, in radii of the object
constexpr Duration kTogether = std::chrono::milliseconds(40);  // frames of one pair, at most
constexpr Duration kShownFor = std::chrono::milliseconds(50);

TriangleMesh triangles_of(const RenderMesh& mesh) {
  TriangleMesh triangles;
  for (uint32_t i = 0; i < mesh.vertex_count(); ++i) {
    triangles.vertices.push_back(mesh.vertex(i).cast<float>());
  }
  triangles.faces = mesh.faces;
  return triangles;
}

std::optional<Rigid3> tracked_at(const PoseTrack& track, Time time) {
  const PoseAt at = track.at(time);
  const bool measured =
      at.estimate.state == TrackState::kTracking || at.estimate.state == TrackState::kDegraded;
  if (at.source == PoseSource::kNone || !measured) return std::nullopt;
  return at.estimate.world_from_object;
}

}  // namespace

Result<std::unique_ptr<PointCollector>> PointCollector::create(const Installation& installation,
                                                               const Rig& rig) {
  auto collector = std::make_unique<PointCollector>();
  for (const CameraConfig& camera : installation.cameras) {
    collector->cameras_.push_back(camera.calibration);
  }
  collector->newest_.resize(collector->cameras_.size());
  for (const RigObject& object : rig.objects) {
    Object made;
    made.id = object.named.id;
    made.center = object.mesh->center.cast<double>();
    made.radius = static_cast<double>(object.mesh->radius);
    made.surface = std::make_unique<MeshDistance>(triangles_of(*object.mesh));
    const DepthRendererFactory factory = mesh_depth_renderer_factory(object.mesh);
    for (const CalibratedCamera& camera : collector->cameras_) {
      made.outline.push_back(factory(camera.model));
    }
    collector->objects_.push_back(std::move(made));
  }
  return collector;
}

void PointCollector::step(std::span<const std::pair<CameraId, FramePtr>> frames,
                          std::span<const PoseTrackPtr> tracks) {
  for (const auto& [camera, frame] : frames) {
    if (frame->info().status == FrameStatus::kGood) newest_[camera.index()] = frame;
  }
  for (Object& object : objects_) {
    for (const PoseTrackPtr& track : tracks) {
      if (track && track->object() == object.id) look(object, *track);
    }
  }
}

void PointCollector::look(Object& object, const PoseTrack& track) {
  if (track.empty()) return;
  const auto pose = tracked_at(track, track.newest().time);
  if (!pose) return;
  const StereoRegion region{*pose * object.center, kRoom * object.radius};
  for (const auto& [first, second] : stereo_pairs(cameras_, region, finder_.options())) {
    if (!newest_[first] || !newest_[second]) continue;
    const Time a = newest_[first]->info().capture, b = newest_[second]->info().capture;
    Time& done = object.done.try_emplace({first, second}, Time::min()).first->second;
    if (std::chrono::abs(a - b) > kTogether || std::min(a, b) <= done) continue;
    done = std::max(a, b);
    find(object, track, first, second);
  }
}

void PointCollector::find(Object& object, const PoseTrack& track, size_t first, size_t second) {
  const Frame &a = *newest_[first], &b = *newest_[second];
  const auto pose_a = tracked_at(track, a.info().capture);
  const auto pose_b = tracked_at(track, b.info().capture);
  if (!pose_a || !pose_b) return;
  const bool a_later = a.info().capture >= b.info().capture;
  const Rigid3& now = a_later ? *pose_a : *pose_b;
  const CalibratedCamera camera_a = moved_with(cameras_[first], *pose_a, now);
  const CalibratedCamera camera_b = moved_with(cameras_[second], *pose_b, now);
  std::vector<ScenePoint> points;
  finder_.find({&camera_a, a.grey()}, {&camera_b, b.grey()},
               {now * object.center, kRoom * object.radius}, points);
  ++sets_;
  judge(object, now, first, camera_a.world_from_camera, points);
  const Time time = std::max(a.info().capture, b.info().capture);
  if (time != shown_time_) shown_.clear();
  shown_time_ = time;
  shown_.insert(shown_.end(), points.begin(), points.end());
  const Rigid3 camera_from_world = camera_a.world_from_camera.inverse();
  for (const ScenePoint& point : points) {
    const double depth = (camera_from_world * point.point_in_world).z();
    if (collected_.empty()) scale_ = {depth, depth + 1e-3};
    scale_.near_m = std::min(scale_.near_m, depth);
    scale_.far_m = std::max(scale_.far_m, depth);
    collected_.push_back({point, time, depth});
  }
}

void PointCollector::judge(const Object& object, const Rigid3& world_from_object, size_t camera,
                           const Rigid3& world_from_camera, std::span<const ScenePoint> points) {
  const Rigid3 camera_from_world = world_from_camera.inverse();
  const DepthTile tile = object.outline[camera]->render(camera_from_world * world_from_object);
  const Rigid3 object_from_world = world_from_object.inverse();
  for (const ScenePoint& point : points) {
    const auto pixel = cameras_[camera].model.project(camera_from_world * point.point_in_world);
    if (!pixel) continue;
    const int x = static_cast<int>(std::lround(pixel->x()));
    const int y = static_cast<int>(std::lround(pixel->y()));
    if (tile.at(x, y) <= 0) continue;
    distances_.push_back(
        object.surface->nearest(object_from_world * point.point_in_world).distance);
  }
}

void PointCollector::marks(CameraId camera, Time capture, std::vector<PointMark>& out) const {
  out.clear();
  if (shown_.empty() || std::chrono::abs(capture - shown_time_) > kShownFor) return;
  const CalibratedCamera& seen_by = cameras_[camera.index()];
  const Rigid3 camera_from_world = seen_by.world_from_camera.inverse();
  for (const ScenePoint& point : shown_) {
    const Eigen::Vector3d in_camera = camera_from_world * point.point_in_world;
    const auto pixel = seen_by.model.project(in_camera);
    if (pixel && seen_by.model.contains(*pixel)) {
      out.push_back({*pixel, in_camera.z(), point.kind, false});
    }
  }
}

Status PointCollector::write(const std::filesystem::path& path) const {
  std::vector<CloudPoint> cloud;
  cloud.reserve(collected_.size());
  for (const Collected& each : collected_) {
    const Rgb color = depth_color(each.depth, scale_);
    cloud.push_back({each.point, each.time, {color.r, color.g, color.b}});
  }
  return write_point_cloud(path, cloud);
}

PointSummary PointCollector::summary() const {
  PointSummary summary;
  summary.points = collected_.size();
  summary.corners = static_cast<size_t>(
      std::count_if(collected_.begin(), collected_.end(),
                    [](const Collected& each) { return each.point.kind == PointKind::kCorner; }));
  summary.sets = sets_;
  summary.on_object = distances_.size();
  std::vector<double> sorted = distances_;
  std::sort(sorted.begin(), sorted.end());
  if (sorted.empty()) return summary;
  const auto last = static_cast<double>(sorted.size() - 1);
  summary.median_mm = 1e3 * sorted[static_cast<size_t>(0.5 * last)];
  summary.p90_mm = 1e3 * sorted[static_cast<size_t>(0.9 * last)];
  return summary;
}

}  // namespace sightline::cli
