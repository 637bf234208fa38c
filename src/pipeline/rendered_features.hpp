// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/observe/features/feature_model.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/pipeline/surface_samples.hpp"
#include "sightline/render/mesh/mesh_paint.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline::pipeline {

/// What an object is trained by; `images` are the textures of `surface`, one at least.
struct TexturedObject {
  const TriangleMesh& triangles;
  const std::shared_ptr<const RenderMesh>& painted;  ///< of them
  const ViewpointModel& views;
  const MeshSurface& surface;
  const SurfaceImages& images;
};

/// The images of a surface, ready to be drawn.
std::vector<std::shared_ptr<const SurfaceTexture>> surface_textures(const SurfaceImages& images);

/// Trains an object by its own textures: renders it from all sides, at two sizes, and takes the
/// features of these images, as `sightline train` takes them of a camera's. Read from `cache` where
/// they are already there (empty: no cache). Null where there are too few to find it by: a plain
/// print. Some seconds; kUnavailable if stopped.
Result<std::shared_ptr<const FeatureModel>> rendered_features(const TexturedObject& object,
                                                              const std::filesystem::path& cache,
                                                              std::stop_token stop = {});

}  // namespace sightline::pipeline
