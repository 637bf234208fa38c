// SPDX-License-Identifier: Apache-2.0
#include "rig.hpp"

#include <numbers>

#include "mesh_depth_renderer.hpp"
#include "object_views.hpp"
#include "sightline/base/log.hpp"
#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/observe/lookalikes.hpp"
#include "sightline/record/still_picture.hpp"
#include "sightline/render/mesh_paint.hpp"
#include "surface_spots.hpp"

namespace sightline {
namespace {

const CameraConfig& config_of(const Installation& installation, CameraId camera) {
  SL_CHECK(camera.index() < installation.cameras.size(), "camera id of another installation");
  return installation.cameras[camera.index()];
}

float crease_angle(const Installation& installation) {
  return static_cast<float>(installation.render.crease_deg * std::numbers::pi / 180);
}

Result<TriangleMesh> load_mesh(const std::filesystem::path& path, double meters_per_unit,
                               const Installation& installation) {
  MeshOptions options;
  options.meters_per_unit = meters_per_unit;
  options.crease_angle = crease_angle(installation);
  return read_mesh(path, options);
}

/// The mesh's own colours.
Status load_paint(const ObjectDescription& description, RenderMesh& mesh) {
  MeshOptions options;
  options.meters_per_unit = description.meters_per_unit;
  SL_ASSIGN(const MeshSurface surface, read_mesh_surface(description.mesh, options));
  std::vector<std::shared_ptr<const SurfaceTexture>> textures;
  for (const auto& picture : surface_pictures(surface)) {
    textures.push_back(picture ? std::make_shared<const SurfaceTexture>(picture->view()) : nullptr);
  }
  paint_mesh(surface, std::move(textures), mesh);
  if (mesh.paint.empty())
    log::warning("{}: has no colours; its fill is shaded in the state's",
                 description.mesh.string());
  return {};
}

// What an object was taught belongs to its mesh; null if it was taught nothing.
Result<std::shared_ptr<const FeatureModel>> load_features(const ObjectDescription& object,
                                                          const TriangleMesh& mesh) {
  if (object.features.empty()) return std::shared_ptr<const FeatureModel>();
  SL_ASSIGN(FeatureModel model, read_feature_model(object.features));
  if (model.mesh == mesh_content(mesh)) {
    return std::make_shared<const FeatureModel>(std::move(model));
  }
  return make_error(ErrorCode::kInvalidInput, object.features.string(),
                    "was taught on another mesh than {} (or in another unit): teach {} again "
                    "(sightline teach)",
                    object.mesh.string(), object.name);
}

// The depth image of a camera, which has the camera's size.
Result<std::vector<float>> load_scene_depth(const CameraConfig& camera) {
  if (camera.scene_depth.empty()) return std::vector<float>();
  const double usual = camera.scene_depth.extension() == ".exr" ? 1.0 : 0.001;
  const double scale = camera.scene_depth_scale > 0 ? camera.scene_depth_scale : usual;
  SL_ASSIGN(DepthPicture picture, read_depth_picture(camera.scene_depth, scale));
  const CameraModel& lens = camera.calibration.model;
  if (picture.width == lens.width() && picture.height == lens.height()) {
    return std::move(picture.depth);
  }
  return make_error(ErrorCode::kInvalidInput, camera.scene_depth.string(),
                    "is {} x {} pixels, camera {} {} x {}", picture.width, picture.height,
                    camera.name, lens.width(), lens.height());
}

Status load_look(RigObject& object) {
  SL_ASSIGN(object.views, load_views(object, cache_folder()));
  const ObjectDescription& description = object.description;
  object.lookalikes = lookalikes_of(*object.views, description);
  if (const auto& axis = object.lookalikes.axis; axis && !axis->declared) {
    log::info(
        "{}: turns about its axis ({:.2f}, {:.2f}, {:.2f}) do not show; it will be `degraded` "
        "where nothing else tells. If they mean nothing, declare symmetry = \"axis\"",
        description.name, axis->direction.x(), axis->direction.y(), axis->direction.z());
  }
  if (object.lookalikes.turns.empty()) return {};
  SL_ASSIGN(auto spots, surface_spots(description.mesh, description.meters_per_unit));
  if (!spots.empty()) {
    object.spots = std::make_shared<const std::vector<SurfaceSpot>>(std::move(spots));
    return {};
  }
  if (description.cues.fiducial && (description.board || !description.fiducials.empty())) return {};
  log::info(
      "{}: its shape looks the same in {} other poses and its mesh has no colours to tell them "
      "apart; it will be `degraded` where nothing else tells. If they mean the same, declare "
      "its symmetry",
      description.name, object.lookalikes.turns.size());
  return {};
}

}  // namespace

std::vector<NamedObject> Rig::names() const {
  std::vector<NamedObject> out;
  out.reserve(objects.size());
  for (const RigObject& object : objects) out.push_back(object.named);
  return out;
}

std::vector<Lookalikes> Rig::lookalikes() const {
  std::vector<Lookalikes> out;
  for (const RigObject& object : objects) out.push_back(object.lookalikes);
  return out;
}

Result<Rig> load_rig(const Installation& installation) {
  Rig rig;
  RenderMeshOptions options;
  options.crease_angle = crease_angle(installation);
  for (size_t i = 0; i < installation.objects.size(); ++i) {
    const ObjectDescription& description = installation.objects[i].description;
    SL_ASSIGN(TriangleMesh mesh,
              load_mesh(description.mesh, description.meters_per_unit, installation));
    SL_ASSIGN(auto features, load_features(description, mesh));
    RenderMesh prepared = make_render_mesh(mesh, options);
    if (shows_textures(installation)) {
      SL_RETURN_IF_ERROR(load_paint(description, prepared));
    }
    const auto shown = std::make_shared<const RenderMesh>(std::move(prepared));
    rig.objects.push_back({{ObjectId(static_cast<uint32_t>(i)), description.name},
                           description,
                           shown,
                           std::make_shared<const MeshLevels>(shown),
                           std::make_shared<const TriangleMesh>(std::move(mesh)),
                           nullptr,
                           {},
                           nullptr,
                           std::move(features)});
    if (description.cues.look()) SL_RETURN_IF_ERROR(load_look(rig.objects.back()));
  }
  for (const auto& path : installation.scene.meshes) {
    SL_ASSIGN(const TriangleMesh mesh,
              load_mesh(path, installation.scene.meters_per_unit, installation));
    rig.scene.push_back(make_render_mesh(mesh, options));
  }
  for (const CameraConfig& camera : installation.cameras) {
    SL_ASSIGN(std::vector<float> depth, load_scene_depth(camera));
    rig.scene_depth.push_back(std::move(depth));
  }
  return rig;
}

Result<std::unique_ptr<FiducialObserver>> make_observer(const Installation& installation,
                                                        const Rig& rig, CameraId camera) {
  std::vector<ObservedObject> objects;
  for (const RigObject& object : rig.objects) {
    objects.push_back({object.named.id, object.description});
    if (!object.description.cues.fiducial) {
      objects.back().description.fiducials.clear();
      objects.back().description.board.reset();
    }
  }
  const CameraConfig& config = config_of(installation, camera);
  FiducialOptions options = installation.observe;
  if (config.gamma > 0) options.gamma = config.gamma;
  return FiducialObserver::create(config.calibration, camera, std::move(objects), options);
}

Result<std::unique_ptr<OcclusionLearner>> make_learner(const Installation& installation,
                                                       const Rig& rig, CameraId camera) {
  if (!installation.scene.learn) return std::unique_ptr<OcclusionLearner>();
  std::vector<HideableObject> objects;
  for (const RigObject& object : rig.objects) {
    objects.push_back({object.named.id, object.mesh->center.cast<double>(),
                       static_cast<double>(object.mesh->radius),
                       mesh_depth_renderer_factory(object.mesh)});
  }
  return OcclusionLearner::create(config_of(installation, camera).calibration, camera,
                                  std::move(objects));
}

Result<std::unique_ptr<FreeView>> make_view(const Installation& installation, const Rig& rig,
                                            const ViewConfig& view) {
  std::vector<CalibratedCamera> cameras;
  for (const CameraConfig& camera : installation.cameras) cameras.push_back(camera.calibration);
  std::vector<SceneMesh> scene;
  for (const RenderMesh& mesh : rig.scene) scene.push_back({&mesh, Rigid3()});
  std::vector<OverlayObject> objects;
  for (const RigObject& object : rig.objects) {
    objects.push_back({object.named.id, object.named.name, object.mesh, view.overlay});
  }
  FreeViewOptions options;
  options.render = installation.render;
  options.grid_m = view.grid_m;
  return FreeView::create(view.view, std::move(cameras), std::move(objects), scene, options);
}

namespace {

std::shared_ptr<const StaticDepth> static_depth(const Rig& rig, const CalibratedCamera& camera,
                                                CameraId id,
                                                const std::shared_ptr<const RayTable>& rays) {
  const std::vector<float>& depth = rig.scene_depth.at(id.index());
  if (rig.scene.empty() && depth.empty()) return nullptr;
  std::vector<SceneMesh> meshes;
  for (const RenderMesh& mesh : rig.scene) meshes.push_back({&mesh, Rigid3()});
  return StaticDepth::build(rays, camera.world_from_camera, meshes, depth);
}

}  // namespace

SceneDepth make_scene_depth(const Installation& installation, const Rig& rig, CameraId camera) {
  const CalibratedCamera& calibration = config_of(installation, camera).calibration;
  SceneDepth out;
  if (rig.scene.empty() && rig.scene_depth.at(camera.index()).empty()) return out;
  const auto depth = static_depth(rig, calibration, camera, RayTable::build(calibration.model));
  if (!depth || depth->empty()) return out;
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
  const auto rays = RayTable::build(config.calibration.model);
  const auto scene = static_depth(rig, config.calibration, camera, rays);
  std::vector<OverlayObject> objects;
  for (const RigObject& object : rig.objects) {
    objects.push_back(
        {object.named.id, object.named.name, object.mesh, config.overlay, object.levels});
  }
  return CameraRenderer::create(config.calibration, camera, std::move(objects), rays, scene,
                                installation.render);
}

}  // namespace sightline
