// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "sightline/model/depth_renderer.hpp"
#include "sightline/pipeline/camera_geometry.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// Depth images by the CPU rasterizer, for observe. With `camera`, renderers of that camera's own
/// model share its ray table; every other renderer makes one (about 100 ns a pixel).
DepthRendererFactory mesh_depth_renderer_factory(
    std::shared_ptr<const RenderMesh> mesh, std::shared_ptr<const CameraGeometry> camera = nullptr);

}  // namespace sightline
