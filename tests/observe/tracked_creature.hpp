// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "sightline/observe/track/object_tracker.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::test {

inline const TriangleMesh& creature() {
  static const TriangleMesh mesh = make_creature(3000);
  return mesh;
}

/// Its views are made once: that costs most of a second.
inline TrackedObject tracked_creature(const Modalities& modalities) {
  static const DepthRendererFactory depth =
      mesh_depth_renderer_factory(std::make_shared<const RenderMesh>(make_render_mesh(creature())));
  static const auto views = [] {
    ViewpointModelOptions options;
    options.image_px = 240;
    return ViewpointModel::build(creature(), depth, options).value();
  }();
  return {ObjectId(0), views, modalities, depth};
}

}  // namespace sightline::test
