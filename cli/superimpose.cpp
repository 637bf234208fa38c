// SPDX-License-Identifier: Apache-2.0
#include "superimpose.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <iterator>

#include "sightline/render/overlay/camera_renderer.hpp"
#include "sightline/render/overlay/point_marks.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline::cli {
namespace {

Error refusal(const std::vector<PointFile>& files, const SuperimposedPoint& point,
              const CalibratedCamera& camera) {
  const PointFile& file = files[point.file];
  const Eigen::Vector3d& p = point.in_camera;
  return make_error(
      ErrorCode::kInvalidInput, fmt::format("{}:{}", file.name, file.list.lines[point.index]),
      "the point comes to ({:.4g}, {:.4g}, {:.4g}) m in the frame of {}, {}. Is it in the frame "
      "that --points-frame says, in the unit of --points-unit, and are the camera poses right? "
      "--skip-behind leaves such points out",
      p.x(), p.y(), p.z(), camera.name,
      point.state == PointState::kBehind ? "behind the camera" : "beyond what its lens can image");
}

std::shared_ptr<const StaticDepth> depth_of(const std::vector<PlacedMesh>& meshes,
                                            const CalibratedCamera& camera,
                                            const std::shared_ptr<const RayTable>& rays) {
  std::vector<SceneMesh> scene;
  for (const PlacedMesh& each : meshes) scene.push_back({each.mesh.get(), each.world_from_mesh});
  return StaticDepth::build(rays, camera.world_from_camera, scene);
}

}  // namespace

std::string_view to_string(PointState state) {
  constexpr std::array<std::string_view, 5> kNames = {"visible", "hidden", "outside", "behind",
                                                      "beyond_lens"};
  return kNames[static_cast<size_t>(state)];
}

Result<std::vector<SuperimposedPoint>> superimpose_points(const std::vector<PointFile>& files,
                                                          const Rigid3& world_from_points,
                                                          const CalibratedCamera& camera,
                                                          bool skip_behind) {
  const Rigid3 camera_from_world = camera.world_from_camera.inverse();
  std::vector<SuperimposedPoint> out;
  for (size_t f = 0; f < files.size(); ++f) {
    for (size_t i = 0; i < files[f].list.points.size(); ++i) {
      SuperimposedPoint point;
      point.file = f;
      point.index = i;
      point.in_world = world_from_points * files[f].list.points[i];
      point.in_camera = camera_from_world * point.in_world;
      const auto pixel = camera.model.project(point.in_camera);
      if (!pixel) {
        point.state = point.in_camera.z() <= 0 ? PointState::kBehind : PointState::kBeyondLens;
        if (!skip_behind) return refusal(files, point, camera);
      } else {
        point.pixel = *pixel;
        if (!camera.model.contains(*pixel)) point.state = PointState::kOutside;
      }
      out.push_back(point);
    }
  }
  return out;
}

void hide_points(const std::vector<PlacedMesh>& surfaces, const CalibratedCamera& camera,
                 const std::shared_ptr<const RayTable>& rays, double tolerance,
                 std::vector<SuperimposedPoint>& points) {
  if (surfaces.empty()) return;
  const auto depth = depth_of(surfaces, camera, rays);
  for (SuperimposedPoint& point : points) {
    if (point.state != PointState::kVisible) continue;
    const int x = static_cast<int>(std::lround(point.pixel.x()));
    const int y = static_cast<int>(std::lround(point.pixel.y()));
    const double surface = static_cast<double>(depth->row(y)[x]);
    if (surface > (1 + tolerance) / point.in_camera.z()) point.state = PointState::kHidden;
  }
}

Status draw_placed_mesh(const PlacedMesh& object, const std::vector<PlacedMesh>& scene,
                        const CalibratedCamera& camera, const std::shared_ptr<const RayTable>& rays,
                        const OverlayStyle& style, Image& image) {
  const auto hidden_by = scene.empty() ? nullptr : depth_of(scene, camera, rays);
  SL_ASSIGN(
      const auto renderer,
      CameraRenderer::create(camera, CameraId(0), {{ObjectId(0), "object", object.mesh, style}},
                             rays, hidden_by, {}));
  PoseEstimate estimate;
  estimate.object = ObjectId(0);
  estimate.state = TrackState::kTracking;
  estimate.world_from_object = object.world_from_mesh;
  const std::array<PoseTrackPtr, 1> tracks = {
      std::make_shared<const PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise())};
  std::vector<PoseAt> poses;
  renderer->draw(image.mutable_view(), estimate.time, tracks, poses);
  return {};
}

void draw_superimposed(const std::vector<PointFile>& files,
                       const std::vector<SuperimposedPoint>& points, Image& image) {
  std::vector<PointMark> marks;
  for (const SuperimposedPoint& point : points) {
    if (!point.in_image()) continue;
    marks.push_back({point.pixel, point.in_camera.z(), files[point.file].kind,
                     point.state == PointState::kHidden});
  }
  draw_point_marks(image.mutable_view(), marks, fit_depth_scale(marks));
}

std::string format_table(const std::vector<PointFile>& files,
                         const std::vector<SuperimposedPoint>& points) {
  std::string out =
      "kind,file,line,x_world,y_world,z_world,x_camera,y_camera,z_camera,u_px,v_px,state\n";
  for (const SuperimposedPoint& point : points) {
    const PointFile& file = files[point.file];
    const Eigen::Vector3d &w = point.in_world, &c = point.in_camera;
    const bool projected =
        point.state != PointState::kBehind && point.state != PointState::kBeyondLens;
    fmt::format_to(std::back_inserter(out), "{},{},{},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},",
                   to_string(file.kind), file.name, file.list.lines[point.index], w.x(), w.y(),
                   w.z(), c.x(), c.y(), c.z());
    if (projected) {
      fmt::format_to(std::back_inserter(out), "{:.3f},{:.3f}", point.pixel.x(), point.pixel.y());
    } else {
      out += ',';
    }
    fmt::format_to(std::back_inserter(out), ",{}\n", to_string(point.state));
  }
  return out;
}

}  // namespace sightline::cli
