// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <utility>
#include <vector>

#include "sightline/base/snapshot.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// The newest track of every object: fuse publishes, everybody else reads. Any thread.
class TrackBoard {
 public:
  explicit TrackBoard(size_t objects) : tracks_(objects) {}
  size_t size() const { return tracks_.size(); }
  void publish(ObjectId object, PoseTrackPtr track) {
    tracks_.at(object.index()).publish(std::move(track));
  }
  /// One track per object, null before the first; `out` is reused.
  void read(std::vector<PoseTrackPtr>& out) const {
    out.resize(tracks_.size());
    for (size_t i = 0; i < tracks_.size(); ++i) out[i] = tracks_[i].read();
  }

 private:
  std::deque<Snapshot<const PoseTrack>> tracks_;
};

}  // namespace sightline
