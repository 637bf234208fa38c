// SPDX-License-Identifier: Apache-2.0
#include "system/reload_plan.hpp"

#include <algorithm>

namespace sightline {
namespace {

bool names(const std::vector<std::string>& list, const std::string& name) {
  return std::ranges::find(list, name) != list.end();
}

bool same_place(const Installation& before, size_t index, const std::string& name) {
  return index < before.cameras.size() && before.cameras[index].name == name;
}

// A CameraId that was another camera's: what was learned of that one is not true of this one.
bool another_camera(const std::vector<std::string>& known, const Installation& after) {
  for (size_t i = 0; i < std::min(known.size(), after.cameras.size()); ++i) {
    if (!known[i].empty() && known[i] != after.cameras[i].name) return true;
  }
  return false;
}

std::vector<ReloadPlan::Camera> plan_cameras(const Installation& before, const Installation& after,
                                             const InstallationChanges& changes) {
  // Whether frames carry what a recording takes over is decided when a recording is opened.
  const bool payload = before.record.directory.empty() != after.record.directory.empty();
  const bool served = before.rtsp.enabled != after.rtsp.enabled;
  std::vector<ReloadPlan::Camera> plan;
  for (size_t i = 0; i < after.cameras.size(); ++i) {
    const CameraConfig& camera = after.cameras[i];
    const bool restart =
        !same_place(before, i, camera.name) || names(changes.cameras_changed, camera.name) ||
        (payload && camera.source == SourceKind::kReplay) || (served && streams(camera.role));
    const bool restyle = names(changes.cameras_restyled, camera.name);
    plan.push_back(restart   ? ReloadPlan::Camera::kRestart
                   : restyle ? ReloadPlan::Camera::kRestyle
                             : ReloadPlan::Camera::kKeep);
  }
  return plan;
}

}  // namespace

ReloadPlan plan_reload(const Installation& before, const Installation& after,
                       const InstallationChanges& changes,
                       const std::vector<std::string>& fusion_cameras) {
  ReloadPlan plan;
  plan.cameras = plan_cameras(before, after, changes);
  const bool restarts =
      std::ranges::find(plan.cameras, ReloadPlan::Camera::kRestart) != plan.cameras.end();
  const bool cameras = restarts || changes.camera_ids || !changes.cameras_removed.empty();
  const bool objects = changes.object_ids || !changes.objects_added.empty() ||
                       !changes.objects_removed.empty() || !changes.objects_changed.empty();
  plan.rig = objects || cameras || changes.scene || changes.surfaces;
  // CameraIds of other hosts follow this one's.
  const bool moved = changes.cell || (after.cell.enabled() && cameras);
  plan.fusion = objects || changes.estimator || changes.watch || moved ||
                another_camera(fusion_cameras, after);
  plan.observers = plan.fusion || changes.scene || changes.surfaces || changes.observe;
  plan.renderers = plan.observers || changes.render || changes.encoder;
  plan.encoder = changes.encoder;
  plan.search = cameras || plan.observers;
  plan.points = plan.search;
  plan.views =
      changes.views || cameras || plan.renderers || before.rtsp.enabled != after.rtsp.enabled;
  plan.watch = plan.fusion || cameras || changes.calibration;
  plan.recorder = objects || cameras || changes.record;
  plan.rtsp = changes.rtsp;
  plan.http = changes.http;
  plan.actions = changes.action;
  plan.mqtt = changes.mqtt;
  plan.cell = plan.fusion;
  return plan;
}

}  // namespace sightline
