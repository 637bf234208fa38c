// SPDX-License-Identifier: Apache-2.0
#include "pipeline/rendered_features.hpp"
#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/pipeline/mesh_color_renderer.hpp"
#include "sightline/pipeline/surface_samples.hpp"
#include "sightline/render/mesh/mesh_paint.hpp"

namespace sightline {

Result<std::shared_ptr<const RenderMesh>> read_painted_mesh(const TriangleMesh& mesh,
                                                            const std::filesystem::path& file,
                                                            const MeshOptions& options) {
  SL_ASSIGN(const MeshSurface surface, read_mesh_surface(file, options));
  RenderMesh painted = make_render_mesh(mesh);
  paint_mesh(surface, pipeline::surface_textures(surface_images(surface)), painted);
  return std::make_shared<const RenderMesh>(std::move(painted));
}

}  // namespace sightline
