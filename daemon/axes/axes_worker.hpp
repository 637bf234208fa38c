// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/config/camera_config.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/pipeline/track_board.hpp"
#include "sightline/pipeline/turning/follower.hpp"

namespace sightline {

/// What heads may follow, and where it is.
struct FollowScene {
  std::shared_ptr<const TrackBoard> board;
  std::vector<FollowTarget> targets;       ///< the most important first
  std::shared_ptr<FollowSharing> sharing;  ///< with the other heads of the rig
  int head = 0;                            ///< this one's number among them
};

/// Of one camera. `board`: where `rig`'s objects are.
std::shared_ptr<FollowScene> follow_scene(const FollowConfig& config, const Rig& rig,
                                          std::shared_ptr<const TrackBoard> board);

/// The thread "axes:NAME" of a camera that turns: puts what its head says into the history that the
/// frames ask, and, of a camera of role "follow", orders where it turns. A source that cannot be
/// opened is tried again for ever.
class AxesWorker {
 public:
  /// `camera` has axes, and somebody who tells them.
  static std::shared_ptr<AxesWorker> start(const CameraConfig& camera, Registry& registry,
                                           HeartbeatBoard& beats);
  ~AxesWorker();
  /// Nothing is read or ordered any more, soon.
  void request_stop() { thread_.request_stop(); }

  const std::shared_ptr<AxisHistory>& history() const { return history_; }
  /// Whether it may be ordered to turn.
  bool follows() const { return following_; }
  /// What it follows from now on. Any thread, as the rest.
  void follow(std::shared_ptr<const FollowScene> scene) { scene_.publish(std::move(scene)); }
  /// See Follower; `place` must lie within the limits.
  Status hold(const std::optional<HeadAngles>& place, Duration time);
  Status release();
  FollowStatus status() const;
  const FollowConfig& config() const { return config_; }

 private:
  AxesWorker(const CameraConfig& camera, Registry& registry);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  /// Reads until it is stopped or the source is of no use any more.
  Status read(AxisSource& source, const std::stop_token& stop, Heartbeat& heartbeat);
  void report();
  /// Tells the head where to turn, if it is time to.
  void control(AxisSource& source, Time& next);
  void tell_mode(FollowMode mode);

  const std::string name_;
  const AxisSourceOptions options_;
  const bool following_;
  const FollowConfig config_;
  const std::shared_ptr<AxisHistory> history_;
  Counter& readings_;
  Counter& bad_;
  Gauge& known_;
  Counter *ordered_ = nullptr, *refused_ = nullptr;  ///< set if it follows
  Snapshot<const FollowScene> scene_;                ///< null inside: not known yet
  std::vector<PoseTrackPtr> tracks_;
  mutable std::mutex mutex_;  ///< guards follower_
  Follower follower_;
  AxesState told_ = AxesState::kSilent;
  std::jthread thread_;
};

}  // namespace sightline
