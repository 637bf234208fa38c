// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sightline/model/pose_track.hpp"

namespace sightline {

/// An object as those see it who ask whether it may be taken for another one.
struct AlikeObject {
  int kind = -1;  ///< of the same kind: nothing in an image tells them apart; -1: like no other
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< of the bounding sphere, object frame [m]
  double radius = 0;                                 ///< of it [m]
  double thickness = 0;  ///< two of them never have their centers closer than that [m]
};

/// Objects that look alike keep their names by where they were a moment ago. Where that does not
/// tell, they may have been swapped: while one of two that are close is not measured well, or when
/// both were out of sight at the same time. Such a suspicion stays until one of the two is
/// forgotten, since no image can settle it. Two poses at one place cannot both be right: that is
/// suspect as long as it lasts. docs/estimator.md. Passive; one thread.
class SwapWatch {
 public:
  /// By ObjectId; objects beyond them are like no other.
  explicit SwapWatch(const std::vector<AlikeObject>& objects);

  /// Takes the newest estimates (by ObjectId, never null).
  void update(std::span<const PoseTrackPtr> tracks);
  /// The object may be another one of its kind.
  bool suspected(ObjectId object) const {
    return object.index() < suspected_.size() && suspected_[object.index()];
  }
  /// Somebody says which object this is: what was suspected of it is no more.
  void forget(ObjectId object);

 private:
  struct Pair {
    size_t first, second;
    bool apart = false;    ///< they have been seen beside each other, so each has its name
    bool swapped = false;  ///< perhaps, since then
    bool together = false;
  };
  struct Seen {
    bool known = false;                                ///< there is a pose
    bool held = false;                                 ///< and nothing speaks against its place
    Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< world frame
    double sigma = 0;                                  ///< of its place [m]
    Duration unheld{};                                 ///< for so long it has not been held
  };
  Seen look(size_t object, const PoseTrack& track, Time now) const;
  void compare(const Seen& first, const Seen& second, Pair& pair) const;

  std::vector<AlikeObject> objects_;
  std::vector<Pair> pairs_;
  std::vector<Seen> seen_;
  std::vector<Time> held_at_;  ///< by object, last, or when it was found
  std::vector<bool> suspected_;
};

}  // namespace sightline
