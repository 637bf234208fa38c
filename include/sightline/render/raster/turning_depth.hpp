// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sightline/render/raster/static_depth.hpp"

namespace sightline {

class MeshRasterizer;

/// Depth of the static scene in a camera that turns: drawn anew for a frame if the camera turned
/// since the last one by as much as can be seen. Milliseconds each time, so none without a scene.
/// One thread at a time, which also reads depth().
class TurningDepth {
 public:
  /// `scene`: meshes in the world's frame, not null.
  TurningDepth(std::shared_ptr<const RayTable> rays,
               std::shared_ptr<const std::vector<RenderMesh>> scene);
  ~TurningDepth();

  void turn_to(const Rigid3& world_from_camera);
  /// As it was last turned to; the same object and memory all the time.
  const std::shared_ptr<const StaticDepth>& depth() const { return seen_; }

 private:
  const std::shared_ptr<const RayTable> rays_;
  const std::shared_ptr<const std::vector<RenderMesh>> scene_;
  std::vector<SceneMesh> meshes_;
  std::unique_ptr<MeshRasterizer> rasterizer_;
  std::shared_ptr<StaticDepth> depth_;
  std::shared_ptr<const StaticDepth> seen_;  ///< the same
  std::optional<Rigid3> drawn_at_;
};

}  // namespace sightline
