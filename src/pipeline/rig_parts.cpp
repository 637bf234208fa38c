// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/rig_parts.hpp"

#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/render/raster/turning_depth.hpp"

namespace sightline {
namespace {

const CameraConfig& config_of(const Installation& installation, CameraId camera) {
  SL_CHECK(camera.index() < installation.cameras.size(), "camera id of another installation");
  return installation.cameras[camera.index()];
}

// Works on the camera's images only if both were loaded from one installation.
const std::shared_ptr<const CameraGeometry>& geometry_of(const Rig& rig, CameraId camera) {
  SL_CHECK(camera.index() < rig.cameras.size(), "camera id of another rig");
  return rig.cameras[camera.index()];
}

}  // namespace

Result<std::unique_ptr<FiducialObserver>> make_observer(const Installation& installation,
                                                        const Rig& rig, CameraId camera) {
  std::vector<ObservedObject> objects;
  for (const RigObject& object : rig.objects) {
    objects.push_back({object.named.id, object.description});
    if (!object.description.modalities.fiducial) {
      objects.back().description.fiducials.clear();
      objects.back().description.board.reset();
    }
  }
  const CameraConfig& config = config_of(installation, camera);
  FiducialOptions options = installation.fiducial;
  if (config.gamma > 0) options.gamma = config.gamma;
  return FiducialObserver::create(config.calibration, camera, std::move(objects), options);
}

Result<std::unique_ptr<OcclusionLearner>> make_learner(const Installation& installation,
                                                       const Rig& rig, CameraId camera) {
  // What hides objects is learned cell by cell of an image that stands still.
  const bool turns = config_of(installation, camera).calibration.axes.has_value();
  if (!installation.scene.learn || turns) return std::unique_ptr<OcclusionLearner>();
  std::vector<OccludableObject> objects;
  for (const RigObject& object : rig.objects) {
    objects.push_back({object.named.id, object.mesh->center.cast<double>(),
                       static_cast<double>(object.mesh->radius),
                       mesh_depth_renderer_factory(object.mesh, geometry_of(rig, camera))});
  }
  return OcclusionLearner::create(config_of(installation, camera).calibration, camera,
                                  std::move(objects));
}

Result<std::unique_ptr<VirtualCamera>> make_view(const Installation& installation, const Rig& rig,
                                                 const VirtualCameraConfig& view) {
  std::vector<CalibratedCamera> cameras;
  for (const CameraConfig& camera : installation.cameras) cameras.push_back(camera.calibration);
  std::vector<SceneMesh> scene;
  for (const RenderMesh& mesh : *rig.scene) scene.push_back({&mesh, Rigid3()});
  std::vector<OverlayObject> objects;
  for (const RigObject& object : rig.objects) {
    objects.push_back({object.named.id, object.named.name, object.mesh, view.overlay});
  }
  VirtualCameraOptions options;
  options.render = installation.render;
  options.grid_m = view.grid_m;
  return VirtualCamera::create(view.view, std::move(cameras), std::move(objects), scene, options);
}

SceneDepth make_scene_depth(const Rig& rig, CameraId camera) {
  const auto depth = geometry_of(rig, camera)->static_depth();
  if (!depth || depth->empty()) return {};
  return make_scene_depth(depth);
}

SceneDepth make_scene_depth(const std::shared_ptr<const StaticDepth>& depth) {
  SceneDepth out;
  out.tile = {0,
              0,
              depth->width(),
              depth->height(),
              static_cast<ptrdiff_t>(depth->tile().stride()),
              depth->row(0)};
  out.owner = depth;
  return out;
}

Result<std::unique_ptr<CameraRenderer>> make_renderer(const Installation& installation,
                                                      const Rig& rig, CameraId camera) {
  const CameraConfig& config = config_of(installation, camera);
  const auto& geometry = geometry_of(rig, camera);
  std::vector<OverlayObject> objects;
  for (const RigObject& object : rig.objects) {
    objects.push_back(
        {object.named.id, object.named.name, object.mesh, config.overlay, object.levels});
  }
  if (config.calibration.axes) {
    auto turning = std::make_shared<TurningDepth>(geometry->rays(), rig.scene);
    const auto depth = turning->depth();
    return CameraRenderer::create(config.calibration, camera, std::move(objects), geometry->rays(),
                                  depth, installation.render, std::move(turning));
  }
  return CameraRenderer::create(config.calibration, camera, std::move(objects), geometry->rays(),
                                geometry->static_depth(), installation.render);
}

}  // namespace sightline
