// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "sightline/config/follow_config.hpp"
#include "sightline/geometry/axis_history.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// One object that a head may follow.
struct FollowTarget {
  ObjectId object;
  Eigen::Vector3d center_in_object = Eigen::Vector3d::Zero();  ///< [m], what is kept in the middle
};

enum class FollowMode : uint8_t {
  kBlind,      ///< its angles are not known: nothing is ordered
  kFollowing,  ///< an object is kept in the middle
  kWaiting,    ///< no object has a pose: it stands still
  kHome,       ///< for so long that it goes home, or is there
  kHeld,       ///< somebody ordered over HTTP where it is to stand
  kYielding,   ///< somebody else moves it, or it does not do as it is told
};
/// "blind", "following", ...
std::string_view to_string(FollowMode mode);

/// What a follower does, for status.
struct FollowStatus {
  FollowMode mode = FollowMode::kBlind;
  std::optional<ObjectId> object{};        ///< while following
  HeadAngles angles = HeadAngles::Zero();  ///< [rad], newest
  HeadAngles error = HeadAngles::Zero();   ///< [rad], target less angles, while it has a target
  Time until{};                            ///< end of kHeld and kYielding
};

/// Decides where a head that stands under a camera is to turn. It aims at where the object will be
/// once the head obeys, gives way to whoever else moves the head, waits where it lost the object,
/// and goes home after a while. Passive; one thread at a time. Knows nothing of how heads are told.
class Follower {
 public:
  Follower(const FollowConfig& config, const CalibratedCamera& camera);

  /// Somebody takes the head over until `until`: it turns to `place` (as far as its range goes), or
  /// stops where it is.
  void hold(const std::optional<HeadAngles>& place, Time until);
  /// Ends that, and any yielding.
  void release();

  /// To be called some 20 times a second with the newest track of every object (by ObjectId; may be
  /// null) and the objects to follow, the most important first. Empty: nothing is to be ordered.
  std::optional<HeadOrder> step(Time now, const AxisHistory& history,
                                std::span<const PoseTrackPtr> tracks,
                                std::span<const FollowTarget> targets);
  const FollowStatus& status() const { return status_; }

 private:
  struct Goal {
    HeadAngles angles = HeadAngles::Zero(), rates = HeadAngles::Zero();
  };
  std::optional<Goal> see(Time now, std::span<const PoseTrackPtr> tracks,
                          std::span<const FollowTarget> targets);
  std::optional<Goal> aim(Time when, const PoseTrack& track, const FollowTarget& target);
  Goal decide(Time now, std::span<const PoseTrackPtr> tracks,
              std::span<const FollowTarget> targets);
  bool disturbed(Time now);
  HeadAngles stopping_place(Time now) const;
  std::optional<HeadOrder> drive(Time now, const Goal& goal);
  void stop(Time now, FollowMode mode);

  const FollowConfig config_;
  const CameraAxes axes_;
  Eigen::Vector3d ray_;  ///< of the middle of its image
  AxisDrive pan_, tilt_;
  FollowStatus status_;

  struct Seen {
    Time stamp;
    HeadAngles angles;
  };
  std::deque<Seen> seen_;  ///< growing stamps
  Goal last_goal_;         ///< rates smoothed
  Time goal_time_{};       ///< of an object; zero: none yet
  Time lost_{};            ///< since when nothing is followed
  Time disturbed_{};       ///< since when it goes where nobody here ordered it; zero: it does not
  Time quiet_{};           ///< until when its moves say nothing of others: it has just been found
  std::optional<HeadAngles> held_;  ///< where it stands while held or waiting
  HeadOrder sent_;
  bool resting_ = false;  ///< the last order was to stand where it stands
};

}  // namespace sightline
