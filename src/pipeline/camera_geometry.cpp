// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/camera_geometry.hpp"

#include <utility>

namespace sightline {
CameraGeometry::CameraGeometry(CalibratedCamera camera, SceneMeshes scene,
                               std::vector<float> measured_depth)
    : camera_(std::move(camera)),
      scene_(std::move(scene)),
      measured_depth_(std::move(measured_depth)) {}

bool CameraGeometry::fits(const CalibratedCamera& camera) const {
  return camera.model == camera_.model && camera.world_from_camera == camera_.world_from_camera;
}

std::shared_ptr<const RayTable> CameraGeometry::rays() const {
  std::call_once(rays_once_, [this] { rays_ = RayTable::build(camera_.model); });
  return rays_;
}

std::shared_ptr<const RayTable> CameraGeometry::rays(const CameraModel& model) const {
  return model == camera_.model ? rays() : RayTable::build(model);
}

std::shared_ptr<const StaticDepth> CameraGeometry::static_depth() const {
  std::call_once(depth_once_, [this] {
    const bool meshes = scene_ && !scene_->empty();
    if (!meshes && measured_depth_.empty()) return;
    std::vector<SceneMesh> placed;
    if (meshes) {
      for (const RenderMesh& mesh : *scene_) placed.push_back({&mesh, Rigid3()});
    }
    static_depth_ = StaticDepth::build(rays(), camera_.world_from_camera, placed, measured_depth_);
    measured_depth_ = {};
  });
  return static_depth_;
}

}  // namespace sightline
