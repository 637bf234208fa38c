// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "calibrate/watch/camera_evidence.hpp"
#include "sightline/calibrate/scene_watch.hpp"

namespace sightline::calibrate {

/// What a camera's looks at its room came to: where it has turned to since when, or that it is
/// another room.
class SceneEvidence {
 public:
  enum class Event : uint8_t {
    kNone,    ///< nothing new
    kBucket,  ///< seconds of looks, and the verdict is as it was
    kMoved,   ///< it has turned
    kBack,    ///< it had, and stands again where it should
    kUnfit,   ///< another image
    kFits,    ///< its own image again
  };

  explicit SceneEvidence(const CalibrationWatchOptions& options);

  Event add(const SceneLook& look);
  void clear();

  bool moved() const { return moved_; }
  /// Watched for long enough to say anything.
  bool enough() const;
  Time since() const { return since_; }  ///< of the turn, or of the other image
  bool since_start() const { return since_start_; }
  bool drifts() const { return drifts_; }
  const SceneLook& newest() const { return newest_; }
  /// While moved(): the turn, a shift unknown, so that its covariance has what a shift may feign.
  CorrectionFit correction(Vector6& rate) const;

 private:
  Event judge();
  Event judge_moved();

  CalibrationWatchOptions options_;
  CameraEvidence evidence_;
  SceneLook newest_;
  Time bucket_end_ = Time::min();
  bool moved_ = false, drifts_ = false, since_start_ = false, unfit_ = false;
  int confirmed_ = 0, unfit_looks_ = 0, fitting_looks_ = 0;
  Time since_{}, flagged_{};
};

/// Cameras whose pictures became others at about one time, and nobody knows whose: of most cameras
/// of a rig that is the light.
class ChangedTogether {
 public:
  void begin(size_t cameras) { changed_.assign(cameras, std::nullopt); }
  void note(size_t camera, Time now) { changed_[camera] = now; }
  void forget(size_t camera) { changed_[camera].reset(); }
  bool has(size_t camera, Time now) const;
  /// Of those that look at their rooms.
  bool are_most(std::span<const SceneEvidence> scenes, Time now) const;

 private:
  std::vector<std::optional<Time>> changed_;  // by camera
};

}  // namespace sightline::calibrate
