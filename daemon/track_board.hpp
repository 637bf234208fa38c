// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <vector>

#include "sightline/model/pose_track.hpp"

namespace sightline {

/// The newest track of every object: fuse publishes, everybody else reads. Any thread.
class TrackBoard {
 public:
  explicit TrackBoard(size_t objects) : slots_(objects) {}
  size_t size() const { return slots_.size(); }
  void publish(ObjectId object, PoseTrackPtr track) {
    slots_.at(object.index()).publish(std::move(track));
  }
  /// One track per object, null before the first; `out` is reused.
  void read(std::vector<PoseTrackPtr>& out) const {
    out.resize(slots_.size());
    for (size_t i = 0; i < slots_.size(); ++i) out[i] = slots_[i].read();
  }

 private:
  std::deque<TrackSlot> slots_;
};

}  // namespace sightline
