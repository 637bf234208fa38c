// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/track_follower.hpp"

namespace sightline {

void TrackFollower::restart(const PoseTrack* before, Time end) {
  history_.clear();
  silent_.reset();
  if (before == nullptr) return;
  for (const PoseEstimate& estimate : before->history()) {
    if (estimate.time < end) (void)take(estimate);
  }
}

bool TrackFollower::take(const PoseEstimate& estimate) {
  if (!history_.empty()) {
    PoseEstimate& newest = history_.back();
    if (estimate.time < newest.time) return false;
    if (estimate.time == newest.time) history_.pop_back();  // a later measurement has joined it
  }
  if (history_.size() >= kKept) history_.erase(history_.begin());
  history_.push_back(estimate);
  history_.back().object = object_;
  silent_.reset();
  return true;
}

std::optional<PoseEstimate> TrackFollower::advance(Time now) {
  if (history_.empty()) return std::nullopt;
  const PoseEstimate& newest = history_.back();
  const TrackState before = silent_ ? silent_->state : newest.state;
  if (before == TrackState::kSearching) return std::nullopt;
  const Duration unseen = now - newest.last_measured;
  TrackState state = before;
  if (unseen > PoseTrack::kCoastLimit + kSearchingAfter) {
    state = TrackState::kSearching;
  } else if (unseen > PoseTrack::kCoastLimit) {
    state = TrackState::kLost;
  } else if (unseen > 2 * PoseTrack::kFreshFor && has_pose(before)) {  // transport has its share
    state = TrackState::kCoasting;
  }
  if (state == before) return std::nullopt;
  PoseEstimate estimate;
  if (has_pose(state)) {
    estimate = predict(newest, now, noise_);
  } else {
    estimate.time = now;
    estimate.last_measured = newest.last_measured;
  }
  estimate.object = object_;
  estimate.state = state;
  estimate.cameras = 0;
  silent_ = estimate;
  return estimate;
}

PoseTrackPtr TrackFollower::track() const {
  std::vector<PoseEstimate> history = history_;
  if (silent_) history.push_back(*silent_);
  return std::make_shared<const PoseTrack>(object_, std::move(history), noise_);
}

}  // namespace sightline
