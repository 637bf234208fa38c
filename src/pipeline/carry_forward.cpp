// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/carry_forward.hpp"

#include <algorithm>
#include <iterator>

namespace sightline {
namespace {

Time newest_capture(const std::vector<Observation>& found) {
  return std::max_element(
             found.begin(), found.end(),
             [](const Observation& a, const Observation& b) { return a.capture < b.capture; })
      ->capture;
}

Time newest_capture(const std::vector<FramePtr>& frames) {
  Time newest = Time::min();
  for (const FramePtr& frame : frames) newest = std::max(newest, frame->info().capture);
  return newest;
}

// The further behind, the longer: every step costs the same.
constexpr int kStepsToNow = 4;
// And longer than they take by so much, or by half: else now is never reached. Frames are apart,
// and the longer the way the farther (FrameTrail).
constexpr Duration kGain = std::chrono::milliseconds(60);

}  // namespace

CarryForward::CarryForward(std::vector<Observation> found, const CarryOptions& options)
    : options_(options), found_(std::move(found)) {
  if (!found_.empty()) now_ = newest_capture(found_);
}

Duration CarryForward::next_step(Time newest) const {
  if (!stepped_) return options_.first_step;
  const Duration took = newest - *stepped_;
  return std::max(
      std::clamp<Duration>((newest - now_) / kStepsToNow, options_.step, options_.max_step),
      took + std::max(kGain, took / 2));
}

bool CarryForward::step(FrameTrail& trail, const FollowStep& follow) {
  // Where it was not seen, the end of the way is no place to leave it: a newer frame may show it.
  // Elsewhere a step that has seen the newest frame is the last: another one would end as late.
  const auto more = [&] {
    if (misses_ > 0) return trail.newest() > now_;
    return !caught_up_ && trail.newest() > now_ + options_.close_enough;
  };
  while (!found_.empty() && more()) {
    const Time newest = trail.newest();
    const Duration step = next_step(newest);
    caught_up_ = newest - now_ <= step;
    now_ += step;
    const std::vector<FramePtr> frames = trail.take_until(now_);
    if (frames.empty()) continue;
    stepped_ = newest;
    std::vector<Observation> moved = follow(frames);
    if (!moved.empty()) {
      misses_ = 0;
      now_ = newest_capture(moved);
      std::move(moved.begin(), moved.end(), std::back_inserter(found_));
    } else if (++misses_ > options_.max_misses) {
      found_.clear();
    } else {
      now_ = newest_capture(frames);
    }
    return !found_.empty();
  }
  return false;
}

std::vector<Observation> CarryForward::take() {
  if (misses_ > 0) return {};
  std::erase_if(found_, [this](const Observation& o) { return o.capture < now_ - options_.way; });
  std::stable_sort(found_.begin(), found_.end(), [](const Observation& a, const Observation& b) {
    return a.capture < b.capture;
  });
  // What refutes the pose in force starts anew once; the rest of the way says how it moves.
  for (Observation& o : found_) o.refutes &= o.capture == found_.front().capture;
  return std::move(found_);
}

std::vector<Observation> carry_forward(FrameTrail& trail, std::vector<Observation> found,
                                       const FollowStep& follow, const std::function<bool()>& go_on,
                                       const CarryOptions& options) {
  CarryForward carry(std::move(found), options);
  while (go_on() && carry.step(trail, follow)) {
  }
  return carry.take();
}

}  // namespace sightline
