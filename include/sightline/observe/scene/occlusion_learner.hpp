// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/occlusion_depth.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// An object whose absence trains what hides it.
struct OccludableObject {
  ObjectId id;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< of its bounding sphere, object frame [m]
  double radius = 0;                                 ///< [m]
  DepthRendererFactory depth;
};

/// Learns what stands between one camera and the objects, without a model of the scene: where the
/// other cameras hold the object's pose and this image does not show the object inside its own
/// projection, something nearer is in the way (docs/overlay.md says how it judges). Passive; one
/// thread at a time; deterministic. Allocates nothing once the largest projection has been seen.
class OcclusionLearner {
 public:
  /// Refused: an object without depth renderer or of no size.
  static Result<std::unique_ptr<OcclusionLearner>> create(const CalibratedCamera& camera,
                                                          CameraId id,
                                                          std::vector<OccludableObject> objects);
  ~OcclusionLearner();

  /// Learns from a frame with the newest tracks, those of this very frame where they are known.
  /// Damaged frames and those of another size are left out.
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks);

  /// What hides the objects where they were in the newest frame; null: nothing.
  OcclusionDepthPtr hidden() const;

  /// What a step came to, over all objects.
  struct StepResult {
    int judged = 0;     ///< objects whose pose the other cameras held
    int cells = 0;      ///< cells that they cover
    int hidden = 0;     ///< of these
    int learned = 0;    ///< hidden since this frame
    int forgotten = 0;  ///< seen again since this frame
  };
  const StepResult& last_step() const;

 private:
  class Impl;
  explicit OcclusionLearner(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
