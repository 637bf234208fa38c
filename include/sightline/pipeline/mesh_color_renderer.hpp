// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "sightline/model/depth_renderer.hpp"
#include "sightline/pipeline/camera_geometry.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// Depth, own colors and sides of a painted mesh by the CPU rasterizer, for observe. `camera`: as
/// of mesh_depth_renderer_factory().
ColorRendererFactory mesh_color_renderer_factory(
    std::shared_ptr<const RenderMesh> painted,
    std::shared_ptr<const CameraGeometry> camera = nullptr);

}  // namespace sightline
