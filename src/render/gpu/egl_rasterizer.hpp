// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "render/gpu/egl_context.hpp"
#include "render/gpu/egl_meshes.hpp"
#include "render/gpu/gl_objects.hpp"
#include "sightline/render/raster/backend.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline::egl {

/// Why a frame was not drawn.
enum class DrawFailure { kNone, kContextLost, kError };

/// The GPU's part of one camera: a context with its own programs, the camera's rays, and the
/// targets, which only ever grow. One thread at a time.
class TileDrawer {
 public:
  static Result<std::unique_ptr<TileDrawer>> create(std::shared_ptr<const Display> display,
                                                    const Context& group,
                                                    std::shared_ptr<MeshStore> meshes,
                                                    std::shared_ptr<const RayTable> rays);
  ~TileDrawer();

  /// RasterBackend::draw(). The tile is only touched if all went well.
  DrawFailure draw(const RenderMesh& mesh, const Rigid3& camera_from_object, RasterTile& tile,
                   std::string& what);

 private:
  /// Everything that lives in the context.
  struct Objects;
  struct View;
  TileDrawer(std::unique_ptr<Context> context, std::shared_ptr<MeshStore> meshes,
             std::shared_ptr<const RayTable> rays);
  Status set_up();
  void upload_rays();
  void upload_lens();
  void reserve(const RenderMesh& mesh, const TileRect& rect);
  View view_of(const Rigid3& camera_from_object, const TileRect& rect) const;
  void project(const RenderMesh& mesh, const MeshTextures& textures, const View& view);
  void draw_faces(const RenderMesh& mesh, const MeshTextures& textures, const View& view,
                  bool number_faces);
  void read_back(const TileRect& rect);
  void merge(RasterTile& tile) const;

  std::unique_ptr<Context> context_;
  std::shared_ptr<MeshStore> meshes_;
  std::shared_ptr<const RayTable> rays_;
  std::unique_ptr<Objects> gl_;
  std::vector<uint32_t> pixels_;
  size_t words_per_pixel_ = 2;
};

}  // namespace sightline::egl
