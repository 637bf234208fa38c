// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/raster/turning_depth.hpp"

#include "sightline/render/raster/raster.hpp"

namespace sightline {
namespace {

// A tenth of a pixel of a long lens; and as much of a room.
constexpr double kTurned = 1e-4;   // [rad]
constexpr double kShifted = 1e-4;  // [m]

}  // namespace

TurningDepth::TurningDepth(std::shared_ptr<const RayTable> rays,
                           std::shared_ptr<const std::vector<RenderMesh>> scene)
    : rays_(std::move(rays)),
      scene_(std::move(scene)),
      rasterizer_(std::make_unique<MeshRasterizer>(rays_)),
      depth_(new StaticDepth),
      seen_(depth_) {
  for (const RenderMesh& mesh : *scene_) meshes_.push_back({&mesh, Rigid3()});
  depth_->draw(*rasterizer_, *rays_, Rigid3(), {}, {});
}

TurningDepth::~TurningDepth() = default;

void TurningDepth::turn_to(const Rigid3& world_from_camera) {
  if (meshes_.empty()) return;
  if (drawn_at_ && rotation_angle(*drawn_at_, world_from_camera) < kTurned &&
      translation_distance(*drawn_at_, world_from_camera) < kShifted) {
    return;
  }
  drawn_at_ = world_from_camera;
  depth_->draw(*rasterizer_, *rays_, world_from_camera, meshes_, {});
}

}  // namespace sightline
