// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/file_check.hpp"

#include <set>
#include <utility>
#include <vector>

#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/pipeline/camera_observer.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/rig_parts.hpp"
#include "sightline/pipeline/surface_samples.hpp"
#include "sightline/record/recording.hpp"

namespace sightline {
namespace {

template <typename T>
Status status_of(const Result<T>& result) {
  return result ? Status() : Status(result.error());
}

// A mesh that cannot be read at all is said by load_rig().
Status check_textures(const ObjectDescription& object, const Executor& executor) {
  MeshOptions options;
  options.meters_per_unit = object.meters_per_unit;
  const auto surface = read_mesh_surface(object.mesh, options);
  if (!surface) return {};
  return for_each_index(executor, surface->textures.size(),
                        [&](size_t i) { return status_of(read_texture(*surface, i)); });
}

Status check_recordings(const Installation& installation, const Executor& executor) {
  std::set<std::filesystem::path> folders;
  for (const CameraConfig& camera : installation.cameras) {
    if (camera.source == SourceKind::kReplay) folders.insert(camera.recording);
  }
  const std::vector<std::filesystem::path> all(folders.begin(), folders.end());
  return for_each_index(executor, all.size(),
                        [&](size_t i) { return status_of(open_recording(all[i])); });
}

Status check_camera(const Installation& installation, const Rig& rig, CameraId id) {
  const CameraConfig& camera = installation.cameras[id.index()];
  if (observes(camera.role)) {
    SL_RETURN_IF_ERROR(status_of(CameraObserver::create(installation, rig, id)));
  }
  if (!streams(camera.role)) return {};
  SL_RETURN_IF_ERROR(status_of(make_learner(installation, rig, id)));
  return status_of(make_renderer(installation, rig, id));
}

// What is made of the rig: cameras, then views, then the search.
Status check_parts(const Installation& installation, const Rig& rig, const Executor& executor) {
  const size_t cameras = installation.cameras.size(), views = installation.virtual_cameras.size();
  return for_each_index(executor, cameras + views + 1, [&](size_t i) -> Status {
    if (i < cameras) return check_camera(installation, rig, CameraId(static_cast<uint32_t>(i)));
    i -= cameras;
    if (i == views) return status_of(ObjectSearch::create(installation, rig));
    return status_of(make_view(installation, rig, installation.virtual_cameras[i]));
  });
}

}  // namespace

Status check_files(const Installation& installation, const RigOptions& options) {
  Installation checked = installation;
  checked.render.backend = RasterChoice::kCpu;  // a GPU is a device
  std::vector<Error> errors;
  const auto note = [&errors](const Status& done) {
    if (!done) errors.push_back(done.error());
  };
  for (const ObjectConfig& object : checked.objects) {
    note(check_textures(object.description, options.executor));
  }
  note(check_recordings(checked, options.executor));
  const auto rig = load_rig(checked, options);
  note(rig ? check_parts(checked, *rig, options.executor) : Status(rig.error()));
  return errors.empty() ? Status() : join_errors(errors);
}

}  // namespace sightline
