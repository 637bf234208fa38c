// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/rig.hpp"

#include <algorithm>
#include <optional>

#include "pipeline/rig_object.hpp"
#include "sightline/observe/features/feature_model.hpp"
#include "sightline/record/still_image.hpp"

namespace sightline {

using namespace pipeline;

namespace {

// The depth image of a camera, which has the camera's size.
Result<std::vector<float>> load_scene_depth(const CameraConfig& camera) {
  if (camera.scene_depth.empty()) return std::vector<float>();
  const double usual = camera.scene_depth.extension() == ".exr" ? 1.0 : 0.001;
  const double scale = camera.scene_depth_scale > 0 ? camera.scene_depth_scale : usual;
  SL_ASSIGN(DepthImage image, read_depth_image(camera.scene_depth, scale));
  const CameraModel& lens = camera.calibration.model;
  if (image.width == lens.width() && image.height == lens.height()) {
    return std::move(image.depth);
  }
  return make_error(ErrorCode::kInvalidInput, camera.scene_depth.string(),
                    "is {} x {} pixels, camera {} {} x {}", image.width, image.height, camera.name,
                    lens.width(), lens.height());
}

template <typename Configs, typename Name>
std::optional<size_t> index_of(const Configs& configs, const Name& named) {
  const auto found = std::find_if(configs.begin(), configs.end(), named);
  if (found == configs.end()) return std::nullopt;
  return static_cast<size_t>(found - configs.begin());
}

/// What of a rig that is loaded already another one can share.
class Reuse {
 public:
  Reuse(const LoadedRig& before, const Installation& now) : before_(before), now_(now) {
    if (before_.rig != nullptr) changes_ = compare(*before_.installation, now);
  }

  bool scene() const { return before_.rig != nullptr && !changes_.scene && !changes_.surfaces; }

  /// Null: none.
  const RigObject* object(const ObjectConfig& config) const {
    if (before_.rig == nullptr || changes_.surfaces) return nullptr;
    const std::string& name = config.description.name;
    const auto& changed = changes_.objects_changed;
    if (std::find(changed.begin(), changed.end(), name) != changed.end()) return nullptr;
    const auto& objects = before_.installation->objects;
    const auto index = index_of(
        objects, [&](const ObjectConfig& other) { return other.description.name == name; });
    if (!index) return nullptr;
    const bool same = needs_of(*before_.installation, objects[*index].description) ==
                      needs_of(now_, config.description);
    return same ? &before_.rig->objects[*index] : nullptr;
  }

  /// Null: none.
  std::shared_ptr<const CameraGeometry> camera(const CameraConfig& config) const {
    if (!scene()) return nullptr;
    const auto& cameras = before_.installation->cameras;
    const auto index =
        index_of(cameras, [&](const CameraConfig& other) { return other.name == config.name; });
    if (!index || !same_scene_depth(cameras[*index], config)) return nullptr;
    const auto& geometry = before_.rig->cameras[*index];
    return geometry->fits(config.calibration) ? geometry : nullptr;
  }

 private:
  const LoadedRig& before_;
  const Installation& now_;
  InstallationChanges changes_;
};

/// Loads the parts of a rig, each of which stands for itself.
class Loader {
 public:
  Loader(const Installation& installation, const RigOptions& options)
      : installation_(installation), options_(options), reuse_(options.before, installation) {}

  Result<Rig> load() {
    rig_.objects.resize(installation_.objects.size());
    rig_.cameras.resize(installation_.cameras.size());
    scene_.resize(reuse_.scene() ? 0 : installation_.scene.meshes.size());
    depth_.resize(installation_.cameras.size());
    const size_t parts = rig_.objects.size() + scene_.size() + depth_.size();
    SL_RETURN_IF_ERROR(for_each_index(options_.executor, parts, [this](size_t i) -> Status {
      if (options_.stop.stop_requested()) {
        return make_error(ErrorCode::kUnavailable, installation_.file.string(),
                          "was being loaded when the program was told to stop");
      }
      if (i < rig_.objects.size()) return load_object_at(i);
      i -= rig_.objects.size();
      return i < scene_.size() ? load_scene_mesh(i) : load_depth(i - scene_.size());
    }));
    rig_.scene = reuse_.scene()
                     ? options_.before.rig->scene
                     : std::make_shared<const std::vector<RenderMesh>>(std::move(scene_));
    for (size_t i = 0; i < rig_.cameras.size(); ++i) {
      if (rig_.cameras[i]) continue;
      rig_.cameras[i] = std::make_shared<const CameraGeometry>(installation_.cameras[i].calibration,
                                                               rig_.scene, std::move(depth_[i]));
    }
    return std::move(rig_);
  }

 private:
  Status load_object_at(size_t i) {
    const ObjectId id(static_cast<uint32_t>(i));
    const RigObject* const loaded = reuse_.object(installation_.objects[i]);
    if (loaded == nullptr) {
      SL_ASSIGN(rig_.objects[i], load_object(installation_, id, options_));
      return {};
    }
    rig_.objects[i] = *loaded;
    rig_.objects[i].named.id = id;
    rig_.objects[i].description = installation_.objects[i].description;
    return {};
  }

  Status load_scene_mesh(size_t i) {
    const SceneConfig& scene = installation_.scene;
    SL_ASSIGN(const TriangleMesh mesh,
              load_mesh(scene.meshes[i], scene.meters_per_unit, installation_));
    scene_[i] = make_render_mesh(mesh, render_mesh_options(installation_));
    return {};
  }

  Status load_depth(size_t i) {
    rig_.cameras[i] = reuse_.camera(installation_.cameras[i]);
    if (rig_.cameras[i]) return {};
    SL_ASSIGN(depth_[i], load_scene_depth(installation_.cameras[i]));
    return {};
  }

  const Installation& installation_;
  const RigOptions& options_;
  const Reuse reuse_;
  Rig rig_;
  std::vector<RenderMesh> scene_;
  std::vector<std::vector<float>> depth_;  // by CameraId; empty: none, or reused
};

}  // namespace

std::vector<NamedObject> Rig::names() const {
  std::vector<NamedObject> out;
  out.reserve(objects.size());
  for (const RigObject& object : objects) out.push_back(object.named);
  return out;
}

std::vector<ShapeSymmetry> Rig::shape_symmetry() const {
  std::vector<ShapeSymmetry> out;
  for (const RigObject& object : objects) out.push_back(object.shape_symmetry);
  return out;
}

std::vector<AlikeObject> Rig::alike() const {
  std::vector<AlikeObject> out(objects.size());
  const auto same = [&](const RigObject& a, const RigObject& b) {
    return !has_markers(a.description) && !has_markers(b.description) &&
           mesh_content(*a.triangles) == mesh_content(*b.triangles);
  };
  for (size_t i = 0; i < objects.size(); ++i) {
    const RenderMesh& mesh = *objects[i].mesh;
    out[i].center = mesh.center.cast<double>();
    out[i].radius = double{mesh.radius};
    out[i].thickness = double{(mesh.max_corner - mesh.min_corner).minCoeff()};
    for (size_t k = 0; k < i && out[i].kind < 0; ++k) {
      if (!same(objects[k], objects[i])) continue;
      out[i].kind = out[k].kind = static_cast<int>(k);
    }
  }
  return out;
}

Result<Rig> load_rig(const Installation& installation, const RigOptions& options) {
  return Loader(installation, options).load();
}

bool has_markers(const ObjectDescription& object) {
  return object.modalities.fiducial && (object.board.has_value() || !object.fiducials.empty());
}

}  // namespace sightline
