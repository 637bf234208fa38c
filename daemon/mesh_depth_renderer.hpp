// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "sightline/model/depth_renderer.hpp"
#include "sightline/render/render_mesh.hpp"

namespace sightline {

/// Depth pictures by the CPU rasteriser, for observe. Each renderer makes a ray table of its own
/// (about 100 ns a pixel).
DepthRendererFactory mesh_depth_renderer_factory(std::shared_ptr<const RenderMesh> mesh);

}  // namespace sightline
