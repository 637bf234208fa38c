// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/fuse/swap_watch.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/observe/features/feature_model.hpp"
#include "sightline/observe/track/object_tracker.hpp"
#include "sightline/pipeline/camera_geometry.hpp"
#include "sightline/pipeline/object_views.hpp"
#include "sightline/pipeline/parallel.hpp"
#include "sightline/render/mesh/level_of_detail.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// One object, ready to be observed, searched for and drawn.
struct RigObject {
  NamedObject named;
  ObjectDescription description;
  std::shared_ptr<const RenderMesh> mesh;
  std::shared_ptr<const LevelOfDetail> levels;    ///< of it, for what is small in the image
  std::shared_ptr<const TriangleMesh> triangles;  ///< the same, as read
  /// Null if it is neither measured by its own look nor searched for.
  std::shared_ptr<const ViewpointModel> views;
  ShapeSymmetry shape_symmetry;  ///< poses that its shape cannot tell apart; none without `views`
  /// The colors of its mesh, if it is searched for or has a symmetry; null: not needed, or one
  /// color only.
  SurfaceSamples samples;
  bool printed = false;  ///< they are those of a print: the mesh has textures
  /// The mesh with its colors, if it is printed, or if a few other poses have its shape.
  std::shared_ptr<const RenderMesh> painted;
  /// Trained by images, or else by the mesh's own textures; null: none.
  std::shared_ptr<const FeatureModel> features;
};

/// What all cameras share: the meshes of the objects and of the static scene, and of every camera
/// what everything that draws in its image shares. Immutable once loaded; read by every thread.
struct Rig {
  std::vector<RigObject> objects;                              ///< by ObjectId
  CameraGeometry::SceneMeshes scene;                           ///< never null
  std::vector<std::shared_ptr<const CameraGeometry>> cameras;  ///< by CameraId

  std::vector<NamedObject> names() const;
  std::vector<ShapeSymmetry> shape_symmetry() const;  ///< by ObjectId
  /// By ObjectId. Of one kind are those with the same mesh and without markers.
  std::vector<AlikeObject> alike() const;
};

/// A rig and what it was loaded from.
struct LoadedRig {
  const Installation* installation = nullptr;
  const Rig* rig = nullptr;
};

struct RigOptions {
  std::filesystem::path cache = cache_folder();  ///< of viewpoint models; empty: none
  Executor executor = run_in_parallel;
  std::stop_token stop{};  ///< ends the loading with kUnavailable
  /// Objects and cameras that are the same in both installations are taken from this one.
  LoadedRig before{};
};

/// Reads every mesh, depth image and feature file that the installation names, and makes or fetches
/// the viewpoint models. Features that were trained on another mesh are refused. Ray tables and
/// static depth are left to who needs them first. Both programs start here.
Result<Rig> load_rig(const Installation& installation, const RigOptions& options = {});

/// True if nobody has to search for the object: markers find it faster and never mistake it.
bool has_markers(const ObjectDescription& object);

}  // namespace sightline
