// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/observe/feature_model.hpp"
#include "sightline/observe/fiducial_observer.hpp"
#include "sightline/observe/object_tracker.hpp"
#include "sightline/observe/occlusion_learner.hpp"
#include "sightline/render/camera_renderer.hpp"
#include "sightline/render/mesh_levels.hpp"
#include "sightline/render/ray_table.hpp"
#include "sightline/render/render_mesh.hpp"
#include "sightline/render/static_depth.hpp"

namespace sightline {

/// One object, ready to be observed and drawn.
struct RigObject {
  NamedObject named;
  ObjectDescription description;
  std::shared_ptr<const RenderMesh> mesh;
  std::shared_ptr<const MeshLevels> levels;       ///< of it, for what is small in the picture
  std::shared_ptr<const TriangleMesh> triangles;  ///< the same, as read
  std::shared_ptr<const ViewpointModel> views;    ///< null if its look is no cue
  Lookalikes lookalikes;                          ///< poses that its shape cannot tell apart
  SurfaceSpots spots;  ///< its colours, where they are needed to tell them apart; or null
  std::shared_ptr<const FeatureModel> features;  ///< taught; null: none
};

/// What all cameras share: the meshes of the objects and of the static scene. Immutable once
/// loaded; read by every thread.
struct Rig {
  std::vector<RigObject> objects;  ///< by ObjectId
  std::vector<RenderMesh> scene;
  /// By CameraId: measured depth of the static scene, row-major [m]; empty: none.
  std::vector<std::vector<float>> scene_depth;

  std::vector<NamedObject> names() const;
  std::vector<Lookalikes> lookalikes() const;  ///< by ObjectId
};

/// Reads every mesh, depth image and feature file that the installation names, and makes or fetches
/// the viewpoint models. Features that were taught on another mesh are refused. Both programs start
/// here.
Result<Rig> load_rig(const Installation& installation);

/// The per-camera parts, made from the shared ones.
Result<std::unique_ptr<FiducialObserver>> make_observer(const Installation& installation,
                                                        const Rig& rig, CameraId camera);
/// What of the static scene this camera sees, for observe; empty without a scene.
SceneDepth make_scene_depth(const Installation& installation, const Rig& rig, CameraId camera);
Result<std::unique_ptr<CameraRenderer>> make_renderer(const Installation& installation,
                                                      const Rig& rig, CameraId camera);

/// What learns the hidden parts of this camera's picture; null unless [scene] says so.
Result<std::unique_ptr<OcclusionLearner>> make_learner(const Installation& installation,
                                                       const Rig& rig, CameraId camera);

Result<std::unique_ptr<FreeView>> make_view(const Installation& installation, const Rig& rig,
                                            const ViewConfig& view);

}  // namespace sightline
