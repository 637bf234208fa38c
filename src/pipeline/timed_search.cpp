// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/timed_search.hpp"

#include <cmath>

#include "sightline/pipeline/search_cost.hpp"

namespace sightline {

TimedSearch::TimedSearch(ObjectSearch& search, size_t cameras, double cost_factor)
    : search_(search), cost_factor_(cost_factor), trail_(cameras), newest_(cameras) {}

void TimedSearch::charge() {
  SearchWork work = search_.work();
  work -= counted_;
  counted_ += work;
  const Duration cost(std::llround(cost_factor_ * static_cast<double>(search_cost(work).count())));
  done_ += cost;
  charged_ += cost;
}

bool TimedSearch::step(std::span<const PoseTrackPtr> tracks, std::vector<Observation>& found) {
  const FollowStep follow = [&](std::span<const FramePtr> frames) {
    return search_.follow(frames, tracks);
  };
  if (done_ - began_ < kMaxCarry && under_way_->step(trail_, follow)) return true;
  trail_.close();
  found = under_way_->take();
  return false;
}

std::vector<Observation> TimedSearch::advance(Time now, std::span<const PoseTrackPtr> tracks) {
  // When a step begins the trail has all frames up to then: those of `now` are later.
  while (under_way_ && done_ < now) {
    if (checked_) {
      under_way_.reset();
      return {};
    }
    std::vector<Observation> found;
    if (handed_) {
      search_.check_found();
      checked_ = true;
    } else if (!step(tracks, found)) {
      handed_ = !found.empty();
      if (!handed_) under_way_.reset();
    }
    charge();
    if (!found.empty()) return found;
  }
  return {};
}

bool TimedSearch::take(std::span<const CameraFrame> frames, std::span<const PoseTrackPtr> tracks) {
  for (const CameraFrame& seen : frames) {
    newest_.at(seen.camera.index()) = seen.frame;
    trail_.push(seen.camera, *seen.frame);
  }
  if (under_way_ || frames.empty()) return false;
  for (size_t i = 0; i < newest_.size(); ++i) {
    if (!newest_[i]) continue;
    search_.add_frame(CameraId(static_cast<uint32_t>(i)), *newest_[i], tracks);
    newest_[i].reset();
  }
  const Time now = frames.front().frame->info().capture;
  if (!search_.complete(now) || !search_.due(now, tracks)) return false;
  trail_.open();
  began_ = done_ = now;
  counted_ = search_.work();
  handed_ = checked_ = false;
  under_way_.emplace(search_.search(now, tracks));
  charge();
  return true;
}

}  // namespace sightline
