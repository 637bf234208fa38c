// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "sightline/model/pose_track.hpp"

namespace sightline {

/// One object's track as another host estimates it, put together from what arrives. Silence becomes
/// `coasting`, `lost` and `searching`, as in the estimator. Passive; one thread at a time.
class TrackFollower {
 public:
  TrackFollower(ObjectId object, const MotionNoise& noise) : object_(object), noise_(noise) {}

  /// Forgets what it has; what `before` (null: nothing) says of times before `end` is what was
  /// known until then.
  void restart(const PoseTrack* before, Time end);
  /// Takes an estimate; false: it is older than the newest, and nothing changed.
  bool take(const PoseEstimate& estimate);
  /// Tells the time [CLOCK_MONOTONIC, now]; the estimate of a state that silence has changed.
  std::optional<PoseEstimate> advance(Time now);
  /// Snapshot; never null.
  PoseTrackPtr track() const;

  static constexpr size_t kKept = 64;
  static constexpr Duration kSearchingAfter = std::chrono::seconds(10);

 private:
  ObjectId object_;
  MotionNoise noise_;
  std::vector<PoseEstimate> history_;   // as received, oldest first
  std::optional<PoseEstimate> silent_;  // what silence made of the newest
};

}  // namespace sightline
