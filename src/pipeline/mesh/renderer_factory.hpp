// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>

#include "sightline/pipeline/camera_geometry.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline::pipeline {

/// Makes a `Renderer` of the mesh for each camera that asks, as an `Interface`. `camera`: keeps the
/// rays of lenses that are used more than once; null: they are made anew.
template <typename Interface, typename Renderer>
auto renderer_factory(std::shared_ptr<const RenderMesh> mesh,
                      std::shared_ptr<const CameraGeometry> camera) {
  return [mesh = std::move(mesh),
          camera = std::move(camera)](const CameraModel& model) -> std::unique_ptr<Interface> {
    return std::make_unique<Renderer>(camera ? camera->rays(model) : RayTable::build(model), mesh);
  };
}

}  // namespace sightline::pipeline
