// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "sightline/base/log.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/model/stream_types.hpp"

namespace sightline {

/// Tells in the log when an object is found and when it is lost. One that comes and goes within a
/// second is not worth a line. One thread.
class ObjectEvents {
 public:
  /// `objects` by ObjectId.
  explicit ObjectEvents(const std::vector<NamedObject>& objects) {
    for (const NamedObject& object : objects) objects_.push_back({object.name});
  }

  void take(const PoseEstimate& estimate) {
    if (estimate.object.index() >= objects_.size()) return;
    Object& object = objects_[estimate.object.index()];
    const bool seen = has_pose(estimate.state);
    if (seen && !std::exchange(object.seen, true)) object.since = estimate.time;
    if (!seen) object.seen = false;
    if (seen && !object.told && estimate.time - object.since >= kLasting) {
      object.told = true;
      log::info({.object = object.name, .cause = to_string(estimate.state)}, "{}: found",
                object.name);
    } else if (!seen && std::exchange(object.told, false)) {
      log::info({.object = object.name, .cause = to_string(estimate.state)}, "{}: {}", object.name,
                estimate.state == TrackState::kLost ? "lost" : "lost; it is searched for anew");
    }
  }

 private:
  static constexpr Duration kLasting = std::chrono::seconds(1);
  struct Object {
    std::string name;
    bool seen = false, told = false;
    Time since{};
  };
  std::vector<Object> objects_;
};

}  // namespace sightline
