// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "sightline/base/result.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/pipeline/camera_geometry.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// A mesh prepared for rendering, in the colors and textures of its file; `paint` is empty where
/// that has none. `mesh`: what the file was read as, with the same options.
Result<std::shared_ptr<const RenderMesh>> read_painted_mesh(const TriangleMesh& mesh,
                                                            const std::filesystem::path& file,
                                                            const MeshOptions& options);

/// Depth, own colors and sides of a painted mesh by the CPU rasterizer, for observe. `camera`: as
/// of mesh_depth_renderer_factory().
ColorRendererFactory mesh_color_renderer_factory(
    std::shared_ptr<const RenderMesh> painted,
    std::shared_ptr<const CameraGeometry> camera = nullptr);

}  // namespace sightline
