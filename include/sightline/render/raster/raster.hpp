// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "sightline/render/raster/backend.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline {

namespace raster {
struct DrawJob;
}

/// How the inner loops run: lane by lane, by the vectors that each processor of the target has
/// (SSE2, NEON), by AVX2. kAuto takes AVX2 where the processor has it, else kVector. All give the
/// same bits.
enum class RasterKernel { kAuto, kScalar, kVector, kAvx2 };

/// The CPU rasterizer of one camera: triangles are tested at the rays of a RayTable, so the mask is
/// that of a double-precision ray cast through the exact lens. Pixels that float arithmetic cannot
/// decide are decided in double. Shared edges neither crack nor draw twice. One thread; nothing
/// allocates once the largest mesh has been drawn.
class MeshRasterizer final : public RasterBackend {
 public:
  explicit MeshRasterizer(std::shared_ptr<const RayTable> rays,
                          RasterKernel kernel = RasterKernel::kAuto);
  ~MeshRasterizer() override;

  std::string_view name() const override { return "cpu"; }
  const RayTable& rays() const { return *rays_; }

  TileRect bounds(const RenderMesh& mesh, const Rigid3& camera_from_object,
                  int margin_px) const override;
  /// Never fails.
  Status draw(const RenderMesh& mesh, const Rigid3& camera_from_object, RasterTile& tile) override;

  /// bounds(), reset() and draw() in one. The tile is empty if the mesh is out of sight.
  void render(const RenderMesh& mesh, const Rigid3& camera_from_object, int margin_px,
              RasterTile& tile);

  /// Pixels of the last draw() that needed double precision (a handful per frame).
  size_t exact_pixels() const { return exact_pixels_; }

 private:
  struct Scratch;
  void project_vertices();
  size_t list_faces();
  raster::DrawJob draw_job();

  std::shared_ptr<const RayTable> rays_;
  std::unique_ptr<Scratch> scratch_;
  size_t exact_pixels_ = 0;
};

/// A straight piece of a projected line, in frame pixels.
struct EdgeSegment {
  float x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  uint32_t line = 0;    ///< which edge it belongs to; consecutive pieces of one line touch
  bool visible = true;  ///< false: hidden by what the depth tile holds
};

/// Appends the mesh's feature edges through the exact lens, as pieces that stay within 0.1 px of
/// the true curve. `depth` is the tile the same mesh was drawn into at the same pose; a piece is
/// hidden where a surface lies in front of the edge. Pieces outside the frame are left out. Nothing
/// allocates once `out` is large enough.
void visible_edges(const RayTable& rays, const RenderMesh& mesh, const Rigid3& camera_from_object,
                   const RasterTile& depth, std::vector<EdgeSegment>& out);

/// Appends one straight line in space (camera frame, meters) the same way: cut at the near plane
/// and at the lens's fold-over, pieces outside the frame left out. With `depth`, pieces behind its
/// surfaces by more than `tolerance` (relative in 1/z) are marked hidden.
void project_line(const RayTable& rays, const Eigen::Vector3d& start_in_camera,
                  const Eigen::Vector3d& end_in_camera, uint32_t line, const RasterTile* depth,
                  double tolerance, std::vector<EdgeSegment>& out);

}  // namespace sightline
