// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/raster/ray_table.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline {

/// What everything that draws in one camera's image shares: the rays of its pixels and the depth of
/// the static scene. Each is made when it is first asked for, once, by the thread that asks first;
/// others wait for it. Any thread.
class CameraGeometry {
 public:
  using SceneMeshes = std::shared_ptr<const std::vector<RenderMesh>>;

  /// `scene`: meshes in the world's frame, may be null. `measured_depth`: of the scene, row-major,
  /// one number per pixel of the camera [m], 0 where there is no surface; empty: none.
  CameraGeometry(CalibratedCamera camera, SceneMeshes scene, std::vector<float> measured_depth);

  const CalibratedCamera& camera() const { return camera_; }
  /// True if `camera` has this lens and stands here.
  bool fits(const CalibratedCamera& camera) const;
  /// About 100 ns a pixel.
  std::shared_ptr<const RayTable> rays() const;
  /// Rays of `model`: rays() if it is this camera's own, else a table of its own, not kept.
  std::shared_ptr<const RayTable> rays(const CameraModel& model) const;
  /// Null without meshes and measured depth.
  std::shared_ptr<const StaticDepth> static_depth() const;

 private:
  const CalibratedCamera camera_;
  const SceneMeshes scene_;
  mutable std::once_flag rays_once_, depth_once_;
  mutable std::shared_ptr<const RayTable> rays_;
  mutable std::shared_ptr<const StaticDepth> static_depth_;
  mutable std::vector<float> measured_depth_;  ///< emptied once static_depth_ holds it
};

}  // namespace sightline
