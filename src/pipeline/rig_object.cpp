// SPDX-License-Identifier: Apache-2.0
#include "pipeline/rig_object.hpp"

#include <algorithm>
#include <numbers>
#include <optional>

#include "pipeline/rendered_features.hpp"
#include "sightline/base/log.hpp"
#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/observe/shape/shape_symmetry.hpp"
#include "sightline/pipeline/surface_samples.hpp"
#include "sightline/render/mesh/mesh_paint.hpp"

namespace sightline::pipeline {
namespace {

float crease_angle(const Installation& installation) {
  return static_cast<float>(installation.render.crease_deg * std::numbers::pi / 180);
}

// The colors of a mesh, read once for all that ask for them.
class SurfaceReader {
 public:
  explicit SurfaceReader(const ObjectDescription& object) : object_(object) {}

  Result<const MeshSurface*> surface() {
    if (!surface_) {
      MeshOptions options;
      options.meters_per_unit = object_.meters_per_unit;
      SL_ASSIGN(surface_, read_mesh_surface(object_.mesh, options));
      images_ = surface_images(*surface_);
    }
    return &*surface_;
  }
  const SurfaceImages& images() const { return images_; }  ///< after surface()
  /// True if there is any image; after surface().
  bool has_print() const {
    return std::any_of(images_.begin(), images_.end(),
                       [](const auto& image) { return image != nullptr; });
  }

 private:
  const ObjectDescription& object_;
  std::optional<MeshSurface> surface_;
  SurfaceImages images_;
};

Status load_paint(const ObjectDescription& object, SurfaceReader& reader, RenderMesh& mesh) {
  SL_ASSIGN(const MeshSurface* surface, reader.surface());
  paint_mesh(*surface, surface_textures(reader.images()), mesh);
  if (mesh.paint.empty())
    log::warning("{}: has no colors; its fill is shaded in the state's", object.mesh.string());
  return {};
}

// The mesh itself if it has its colors already.
Result<std::shared_ptr<const RenderMesh>> painted_mesh(
    SurfaceReader& reader, const std::shared_ptr<const RenderMesh>& mesh) {
  if (!mesh->paint.empty()) return mesh;
  SL_ASSIGN(const MeshSurface* surface, reader.surface());
  RenderMesh painted = *mesh;
  paint_mesh(*surface, surface_textures(reader.images()), painted);
  return std::make_shared<const RenderMesh>(std::move(painted));
}

// What an object was trained belongs to its mesh; null if it was trained nothing.
Result<std::shared_ptr<const FeatureModel>> load_features(const ObjectDescription& object,
                                                          const TriangleMesh& mesh) {
  if (object.features.empty()) return std::shared_ptr<const FeatureModel>();
  SL_ASSIGN(FeatureModel model, read_feature_model(object.features));
  if (model.mesh == mesh_content(mesh)) {
    return std::make_shared<const FeatureModel>(std::move(model));
  }
  return make_error(ErrorCode::kInvalidInput, object.features.string(),
                    "was trained on another mesh than {} (or in another unit): train {} again "
                    "(sightline train)",
                    object.mesh.string(), object.name);
}

// A print finds an object sooner than its outline, and tells sides apart that have the same
// outline.
Result<std::shared_ptr<const FeatureModel>> features_of_texture(const RigObject& object,
                                                                SurfaceReader& reader,
                                                                const RigOptions& options) {
  SL_ASSIGN(const MeshSurface* surface, reader.surface());
  SL_ASSIGN(auto features, rendered_features({*object.triangles, object.painted, *object.views,
                                              *surface, reader.images()},
                                             options.cache, options.stop));
  if (features) {
    log::info("{}: is also found by {} features of its texture", object.description.name,
              features->features.size());
  }
  return features;
}

Result<SurfaceSamples> load_samples(SurfaceReader& reader) {
  SL_ASSIGN(const MeshSurface* surface, reader.surface());
  auto samples = surface_samples(*surface, reader.images());
  if (samples.empty()) return SurfaceSamples();
  return std::make_shared<const std::vector<SurfaceSample>>(std::move(samples));
}

void log_symmetry(const RigObject& object) {
  const ObjectDescription& description = object.description;
  const ShapeSymmetry& symmetry = object.shape_symmetry;
  if (const auto& axis = symmetry.axis; axis && !axis->declared) {
    log::info(
        "{}: turns about its axis ({:.2f}, {:.2f}, {:.2f}) do not show; it will be `degraded` "
        "where nothing else tells. If they mean nothing, declare symmetry = \"axis\"",
        description.name, axis->direction.x(), axis->direction.y(), axis->direction.z());
  }
  if (symmetry.rotations.empty() || object.samples || has_markers(description)) return;
  log::info(
      "{}: its shape is the same in {} other poses and its mesh has no colors to tell them "
      "apart; it will be `degraded` where nothing else tells. If they mean the same, declare "
      "its symmetry",
      description.name, symmetry.rotations.size());
}

}  // namespace

ObjectNeeds needs_of(const Installation& installation, const ObjectDescription& object) {
  const bool observed =
      std::any_of(installation.cameras.begin(), installation.cameras.end(),
                  [](const CameraConfig& camera) { return observes(camera.role); });
  ObjectNeeds needs;
  needs.searched = installation.detect.enabled && observed && !has_markers(object);
  needs.views = needs.searched || object.modalities.appearance();
  return needs;
}

Result<TriangleMesh> load_mesh(const std::filesystem::path& path, double meters_per_unit,
                               const Installation& installation) {
  MeshOptions options;
  options.meters_per_unit = meters_per_unit;
  options.crease_angle = crease_angle(installation);
  return read_mesh(path, options);
}

RenderMeshOptions render_mesh_options(const Installation& installation) {
  RenderMeshOptions options;
  options.crease_angle = crease_angle(installation);
  return options;
}

Result<RigObject> load_object(const Installation& installation, ObjectId id,
                              const RigOptions& options) {
  const ObjectDescription& description = installation.objects.at(id.index()).description;
  RigObject object;
  object.named = {id, description.name};
  object.description = description;
  SL_ASSIGN(TriangleMesh mesh,
            load_mesh(description.mesh, description.meters_per_unit, installation));
  SL_ASSIGN(object.features, load_features(description, mesh));
  SurfaceReader reader(description);
  RenderMesh prepared = make_render_mesh(mesh, render_mesh_options(installation));
  if (shows_textures(installation)) {
    SL_RETURN_IF_ERROR(load_paint(description, reader, prepared));
  }
  object.triangles = std::make_shared<const TriangleMesh>(std::move(mesh));
  object.mesh = std::make_shared<const RenderMesh>(std::move(prepared));
  object.levels = std::make_shared<const LevelOfDetail>(object.mesh);
  const ObjectNeeds needs = needs_of(installation, description);
  if (!needs.views) return object;
  SL_ASSIGN(object.views, load_views(*object.triangles, object.mesh, description.mesh,
                                     options.cache, options.stop));
  object.shape_symmetry = shape_symmetry_of(*object.views, description);
  if (needs.searched || !object.shape_symmetry.rotations.empty()) {
    SL_ASSIGN(object.samples, load_samples(reader));
    object.printed = object.samples && description.modalities.texture && reader.has_print();
    if (object.printed || (object.samples && object.shape_symmetry.has_few_rotations())) {
      SL_ASSIGN(object.painted, painted_mesh(reader, object.mesh));
    }
  }
  if (needs.searched && object.printed && !object.features) {
    SL_ASSIGN(object.features, features_of_texture(object, reader, options));
  }
  log_symmetry(object);
  return object;
}

}  // namespace sightline::pipeline
