// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline {

/// A mesh and coarser copies of it, so that the cost of drawing follows pixels and not triangles.
/// Immutable; any number of threads.
class LevelOfDetail {
 public:
  /// Halves the mesh with meshoptimizer (quadric edge collapse, Garland and Heckbert 1997) until it
  /// stops or little is left. About 2 s for a million faces. Meshes of fewer than kSmallest faces
  /// stay alone.
  explicit LevelOfDetail(std::shared_ptr<const RenderMesh> mesh);
  static constexpr size_t kSmallest = 500;

  struct Level {
    std::shared_ptr<const RenderMesh> mesh;
    double error;  ///< how far its surface strays from the full mesh's [m]
  };
  /// From the full mesh (error 0) to the coarsest.
  const std::vector<Level>& levels() const { return levels_; }

  /// The coarsest level that is nowhere more than `error_px` off in this camera's image; the full
  /// mesh if the object reaches the camera. 0: always the full mesh.
  const RenderMesh& choose(const CameraModel& camera, const Rigid3& camera_from_object,
                           double error_px) const;

 private:
  std::vector<Level> levels_;
};

}  // namespace sightline
