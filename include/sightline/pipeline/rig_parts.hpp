// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "sightline/observe/fiducial/fiducial_observer.hpp"
#include "sightline/observe/scene/occlusion_learner.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"
#include "sightline/render/overlay/virtual_camera.hpp"

namespace sightline {

// The parts of one camera, made from what the rig shares. `rig` was loaded from `installation`.
// Those of different cameras may be made by different threads at the same time.

Result<std::unique_ptr<FiducialObserver>> make_observer(const Installation& installation,
                                                        const Rig& rig, CameraId camera);

/// What of the static scene this camera sees, for observe; empty without a scene.
SceneDepth make_scene_depth(const Rig& rig, CameraId camera);
/// The same of this depth, which may be drawn anew in place.
SceneDepth make_scene_depth(const std::shared_ptr<const StaticDepth>& depth);

Result<std::unique_ptr<CameraRenderer>> make_renderer(const Installation& installation,
                                                      const Rig& rig, CameraId camera);

/// What learns the hidden parts of this camera's image; null unless [scene] says so, and for a
/// camera that turns.
Result<std::unique_ptr<OcclusionLearner>> make_learner(const Installation& installation,
                                                       const Rig& rig, CameraId camera);

Result<std::unique_ptr<VirtualCamera>> make_view(const Installation& installation, const Rig& rig,
                                                 const VirtualCameraConfig& view);

}  // namespace sightline
