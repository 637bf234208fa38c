// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "observe/track/colors/appearance.hpp"
#include "observe/track/colors/local_colors.hpp"
#include "observe/track/placed_outline.hpp"
#include "observe/track/print/texture_points.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline::observe {

/// True if others hold the object well enough for its outline to be expected where they say.
bool held_by_others(const PoseEstimate& estimate, const TrackerOptions& options);

/// What one camera has learned of an object's appearance, and when it may learn: colors and corners
/// of a frame are noted as it is measured, and kept once that frame's estimate is known and counted
/// this camera.
class LearnedAppearance {
 public:
  LearnedAppearance(const TrackerCamera& camera, CameraId id, const TrackedObject& object);

  const Appearance& colors() const { return colors_; }
  /// By stretch of the outline; known from when the object was held by them
  /// until its colors as a whole tell it clearly.
  const LocalColors& local_colors() const { return local_colors_; }
  TexturePoints* texture() { return texture_.get(); }  ///< null: not a modality of the object
  bool known() const { return colors_.known() || (texture_ && texture_->kept() > 0); }
  /// Known, and of this pose beyond doubt: not learned while it could have been a symmetric one.
  bool certain() const { return known() && !provisional_; }

  /// Learns the colors where a search has found it, in place of all that was learned. Until the
  /// object is tracked they are learned on from each frame, faster than later: what is beside a
  /// moving object changes.
  void initialize(const Frame& frame, const PlacedOutline& outline, size_t aspect);
  /// Whether they are those of where it was found, and it has not been tracked since.
  bool from_detection() const { return from_detection_; }

  /// Keeps what was noted if the track's estimate of that frame allows it. `outline`: as it was
  /// measured then. True if colors were learned.
  bool learn_pending(const PoseTrack& track, const PlacedOutline& outline);
  /// Provisional knowledge becomes certain when the pose does, and worthless when the object is
  /// lost or has turned from the pose measured last to another one.
  void review(const PoseAt& at, const Rigid3& measured);

  /// True if for some frames this camera did not see, or was refused, what the others hold: its
  /// colors may no longer be true.
  bool misses_object(const PoseEstimate& estimate) const;
  void restart_miss_count() { missed_ = 0; }
  void note_missed(const PoseEstimate& estimate);

  /// Notes the colors and corners of a frame in which the object was seen. `result`: how.
  /// `replace`: the colors take the place of all that were learned.
  void note_seen(const Frame& frame, const PlacedOutline& outline, size_t aspect,
                 const ObjectTracker::TrackResult& result, bool replace);

 private:
  /// Of the newest frame, until its estimate is known.
  struct Pending {
    bool any = false;
    bool replace = false;
    Time capture{};
    size_t aspect = 0;
    std::vector<uint16_t> foreground, background;
    bool local = false;  ///< seen by the colors of the stretches
    bool clear = false;  ///< by those as a whole, beyond doubt
    LocalCounts counts;
  };

  void forget();

  const TrackerCamera& camera_;
  const CameraId id_;
  Appearance colors_;
  LocalColors local_colors_;
  std::unique_ptr<TexturePoints> texture_;
  Pending pending_;
  bool provisional_ = false, from_detection_ = false;
  int missed_ = 0;  ///< frames in a row in which others saw it
};

}  // namespace sightline::observe
