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
#include "sightline/pipeline/turning/follow_sharing.hpp"

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
  kScanning,   ///< for so long that it looks around, from where it was last known
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

/// A head among those that share objects.
struct SharedHead {
  FollowSharing& sharing;
  int number = 0;  ///< its own
};

/// Decides where a head that stands under a camera is to turn. It aims at where the object will be
/// once the head obeys, gives way to whoever else moves the head, waits where it lost the object,
/// looks around for it if it is to, and goes home after a while. Passive; one thread at a time.
/// Knows nothing of how heads are told.
class Follower {
 public:
  Follower(const FollowConfig& config, const CalibratedCamera& camera);

  /// Somebody takes the head over until `until`: it turns to `place` (as far as its range goes), or
  /// stops where it is.
  void hold(const std::optional<HeadAngles>& place, Time until);
  /// Ends that, and any yielding.
  void release();

  /// To be called some 20 times a second with the newest track of every object (by ObjectId; may be
  /// null) and the objects to follow, the most important first. `shared`: with other heads, else
  /// the first that has a pose is followed. Empty: nothing is to be ordered.
  std::optional<HeadOrder> step(Time now, const AxisHistory& history,
                                std::span<const PoseTrackPtr> tracks,
                                std::span<const FollowTarget> targets,
                                const std::optional<SharedHead>& shared = {});
  const FollowStatus& status() const { return status_; }

 private:
  struct Goal {
    HeadAngles angles = HeadAngles::Zero(), rates = HeadAngles::Zero();
  };
  struct Seen {
    Time stamp;
    HeadAngles angles;
  };
  /// What is asked of one step.
  struct Scene {
    std::span<const PoseTrackPtr> tracks;
    std::span<const FollowTarget> targets;
    const std::optional<SharedHead>& shared;
  };
  std::optional<Goal> see(Time now, const Scene& scene);
  std::optional<ObjectId> choose(Time now, const Scene& scene,
                                 std::span<const std::optional<Goal>> goals) const;
  Goal smoothed(Time now, ObjectId object, Goal goal);
  std::optional<Goal> aim(Time when, const PoseTrack& track, const FollowTarget& target);
  Goal decide(Time now, const Scene& scene);
  std::optional<Goal> scan(Time now);
  void forget();
  bool disturbed(Time now);
  HeadAngles stopping_place(Time now) const;
  std::optional<HeadOrder> drive(Time now, const Goal& goal);
  void stop(Time now, FollowMode mode);

  const FollowConfig config_;
  const CameraAxes axes_;
  Eigen::Vector3d ray_;  ///< of the middle of its image
  AxisDrive pan_, tilt_;
  FollowStatus status_;

  std::deque<Seen> seen_;  ///< growing stamps
  Goal last_goal_;         ///< rates smoothed
  Time goal_time_{};       ///< of an object; zero: none yet
  Time lost_{};            ///< since when nothing is followed
  Time disturbed_{};       ///< since when it goes where nobody here ordered it; zero: it does not
  Time quiet_{};           ///< until when its moves say nothing of others: it has just been found
  std::optional<HeadAngles> held_;   ///< where it stands while held or waiting
  HeadAngles view_;                  ///< of its picture
  bool scan_due_ = false;            ///< it has followed, and not looked around since
  std::vector<HeadAngles> scan_;     ///< where it looks around; the next place last
  Time scan_there_{}, scan_next_{};  ///< it is at the place since; it goes on by then at the latest
  HeadOrder sent_;
  bool resting_ = false;  ///< the last order was to stand where it stands
};

}  // namespace sightline
