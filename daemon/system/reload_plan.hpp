// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/config/installation.hpp"

namespace sightline {

/// What of a running system another installation makes anew; the rest goes on as it is.
struct ReloadPlan {
  bool rig = false;     ///< meshes, depth images and features are read
  bool fusion = false;  ///< objects are searched for again
  /// Of cameras that go on: what their threads work with. Sources and viewers stay.
  bool observers = false, renderers = false;
  bool encoder = false;
  bool search = false, points = false, views = false;
  bool watch = false;  ///< over the cameras' places
  bool recorder = false, rtsp = false, http = false, actions = false, mqtt = false, cell = false;

  /// By index in the new installation. A camera that goes on keeps its CameraId.
  enum class Camera { kKeep, kRestyle, kRestart };
  std::vector<Camera> cameras;
};

/// `changes` as of compare(before, after); `fusion_cameras` as System::fusion_cameras.
ReloadPlan plan_reload(const Installation& before, const Installation& after,
                       const InstallationChanges& changes,
                       const std::vector<std::string>& fusion_cameras);

}  // namespace sightline
