// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/point_collector.hpp"

#include <algorithm>

namespace sightline {
namespace {

constexpr Duration kShownFor = std::chrono::milliseconds(50);

}  // namespace

PointCollector::PointCollector(const Installation& installation, const Rig& rig)
    : finder_(installation, rig) {
  for (const CameraConfig& camera : installation.cameras) cameras_.push_back(camera.calibration);
}

void PointCollector::step(std::span<const CameraFrame> frames,
                          std::span<const PoseTrackPtr> tracks) {
  for (const CameraFrame& seen : frames) {
    finder_.add_frame(seen.camera, seen.frame);
    const CameraPlacePtr& place = seen.frame->info().place;
    if (place) cameras_[seen.camera.index()].world_from_camera = place->world_from_camera;
  }
  found_.clear();
  finder_.find(tracks, found_);
  for (const ObjectPoints::Found& found : found_) keep(found);
}

void PointCollector::keep(const ObjectPoints::Found& found) {
  ++sets_;
  distances_.insert(distances_.end(), found.distances.begin(), found.distances.end());
  if (found.time != shown_.time) shown_ = {found.time, 0, {}};
  shown_.cameras |= found.cameras;
  shown_.points.insert(shown_.points.end(), found.points.begin(), found.points.end());
  const Rigid3 camera_from_world = found.first.world_from_camera.inverse();
  for (const ScenePoint& point : found.points) {
    const double depth = (camera_from_world * point.point_in_world).z();
    if (collected_.empty()) scale_ = {depth, depth + 1e-3};
    scale_.near_m = std::min(scale_.near_m, depth);
    scale_.far_m = std::max(scale_.far_m, depth);
    collected_.push_back({point, found.time, depth});
  }
}

void PointCollector::marks(CameraId camera, Time capture, std::vector<PointMark>& out) const {
  out.clear();
  if (std::chrono::abs(capture - shown_.time) > kShownFor) return;
  const CalibratedCamera& seen_by = cameras_[camera.index()];
  marks_of_points(seen_by.model, seen_by.world_from_camera.inverse(), shown_.points, out);
}

ScenePointsPtr PointCollector::points_at(Time time) const {
  if (shown_.points.empty() || std::chrono::abs(time - shown_.time) > kShownFor) return nullptr;
  return std::make_shared<const ScenePoints>(shown_);
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

}  // namespace sightline
