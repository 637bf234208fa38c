// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/geometry/mesh.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"
#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline::test {

/// One camera looking along world z from the origin, and one object before it.
struct OverlayScene {
  CalibratedCamera camera;
  std::shared_ptr<const RayTable> rays;
  std::shared_ptr<const RenderMesh> mesh;
  std::shared_ptr<const StaticDepth> depth;

  explicit OverlayScene(int width = 320, int height = 240)
      : camera{"cam", model(width, height), Rigid3(), 0.3},
        rays(RayTable::build(camera.model)),
        mesh(std::make_shared<RenderMesh>(make_render_mesh(make_box({0.2f, 0.14f, 0.1f})))) {}

  static CameraModel model(int width, int height) {
    CameraModel::Parameters lens;
    lens.width = width;
    lens.height = height;
    lens.fx = lens.fy = 0.9 * width;
    lens.cx = 0.5 * width - 3;
    lens.cy = 0.5 * height + 2;
    lens.distortion = {-0.12, 0.03, 4e-4, -3e-4, 0};
    return *CameraModel::create(lens, "cam");
  }

  /// A wall (a thin box) at `center`, one of `size`.
  void build_wall(const Eigen::Vector3d& center, const Eigen::Vector3f& size) {
    const RenderMesh wall = make_render_mesh(make_box(size));
    const SceneMesh placed{&wall, Rigid3(Eigen::Quaterniond::Identity(), center)};
    depth = StaticDepth::build(rays, camera.world_from_camera, std::span(&placed, 1));
  }

  Result<std::unique_ptr<CameraRenderer>> try_renderer(const OverlayStyle& style,
                                                       const RenderOptions& options = {}) const {
    return CameraRenderer::create(camera, CameraId(0), {{ObjectId(7), "box", mesh, style}}, rays,
                                  depth, options);
  }
};

inline constexpr int64_t kCapture = 5'000'000'000;

inline PoseEstimate estimate_at(const Rigid3& world_from_object, TrackState state,
                                int64_t time_ns = kCapture) {
  PoseEstimate estimate;
  estimate.object = ObjectId(7);
  estimate.time = time_from_ns(time_ns);
  estimate.state = state;
  estimate.world_from_object = world_from_object;
  estimate.covariance.diagonal().head<6>().setConstant(1e-6);
  estimate.last_measured =
      state == TrackState::kCoasting ? estimate.time - from_seconds(0.3) : estimate.time;
  return estimate;
}

inline PoseTrackPtr track_of(std::vector<PoseEstimate> history) {
  return std::make_shared<PoseTrack>(ObjectId(7), std::move(history), MotionNoise{});
}

/// Turned so that three faces show.
inline Rigid3 pose_at(double x, double y, double z) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()));
  return Rigid3(turn, {x, y, z});
}

inline OverlayStyle only(std::initializer_list<const char*> names) {
  OverlayStyle style = bare_style();
  for (const char* name : names) *style_flag(style, name) = true;
  return style;
}

}  // namespace sightline::test
