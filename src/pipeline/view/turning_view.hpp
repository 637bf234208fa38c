// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sightline/model/frame.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/render/raster/turning_depth.hpp"

namespace sightline::pipeline {

/// Lets everything that looks at the images of one camera believe that the camera stands still: for
/// each frame the world is turned in front of it instead. What was measured is brought back into
/// the world; tangents of poses are the object's (CONVENTIONS.md), so information and gradients
/// stay as they are. One thread at a time.
class TurningView {
 public:
  /// `world_from_rest`: where those who look believe the camera to be.
  TurningView(const Rigid3& world_from_rest, std::shared_ptr<const RayTable> rays,
              std::shared_ptr<const std::vector<RenderMesh>> scene);

  /// A frame: turns the tracks, and the scene's depth, to its place. False: that is not known.
  bool look(const FrameInfo& info, std::span<const PoseTrackPtr> tracks);
  /// As they pass before the camera at rest: at the time of the frame, and of the one before.
  std::span<const PoseTrackPtr> tracks() const { return tracks_; }
  /// Of the scene, at the place of the frame; the same memory all the time.
  const std::shared_ptr<const StaticDepth>& scene_depth() const { return depth_.depth(); }
  /// Brings what was observed in the frame back into the world.
  void bring_back(std::span<Observation> observations) const;

 private:
  struct Look {
    Time capture{};
    Rigid3 rest_from_world;
  };
  PoseTrackPtr turned(const PoseTrack& track) const;

  const Rigid3 world_from_rest_;
  TurningDepth depth_;
  Look now_;
  std::optional<Look> before_;
  std::shared_ptr<const Matrix6> uncertain_;  ///< of the place, see CameraPlace::covariance
  std::vector<PoseTrackPtr> tracks_;
};

}  // namespace sightline::pipeline
