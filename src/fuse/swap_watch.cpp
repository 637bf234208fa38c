// SPDX-License-Identifier: Apache-2.0
#include "sightline/fuse/swap_watch.hpp"

#include <algorithm>

namespace sightline {
namespace {

// What may be against an object whose place is known all the same.
constexpr DegradedReasons kPlaceKnown =
    kUnconfirmed | kAmbiguous | kWeakRotation | kOneCamera | kPossibleSwap;
// How far one that is not held may be from where it is taken to be: standard deviations, and what
// the two can have moved meanwhile [m/s]. A measurement that is refused in one frame swaps nothing.
// What is out of sight may be anywhere soon, so that it counts up to so many radii.
constexpr double kSigmas = 4, kSpeed = 2, kMostRadii = 4;

}  // namespace

SwapWatch::SwapWatch(const std::vector<AlikeObject>& objects)
    : objects_(objects),
      seen_(objects.size()),
      held_at_(objects.size()),
      suspected_(objects.size(), false) {
  for (size_t i = 0; i < objects_.size(); ++i) {
    for (size_t k = i + 1; k < objects_.size(); ++k) {
      if (objects_[i].kind >= 0 && objects_[i].kind == objects_[k].kind) pairs_.push_back({i, k});
    }
  }
}

SwapWatch::Seen SwapWatch::look(size_t object, const PoseTrack& track, Time now) const {
  Seen out;
  const PoseAt at = track.at(now);
  if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) return out;
  out.known = true;
  out.held = at.estimate.state == TrackState::kTracking ||
             (at.estimate.state == TrackState::kDegraded &&
              (at.estimate.degraded_reasons & ~kPlaceKnown) == 0);
  out.center = at.estimate.world_from_object * objects_[object].center;
  out.sigma = at.estimate.own_sigma_translation();
  return out;
}

void SwapWatch::compare(const Seen& first, const Seen& second, Pair& pair) const {
  pair.together = false;
  if (!first.known && !second.known) {
    pair.swapped |= pair.apart;  // whichever is found next may be either
    return;
  }
  if (!first.known || !second.known) return;
  const AlikeObject& object = objects_[pair.first];
  const double distance = (first.center - second.center).norm();
  pair.together = distance < object.thickness;
  const double reach = kSigmas * std::hypot(first.sigma, second.sigma) +
                       kSpeed * to_seconds(std::max(first.unheld, second.unheld));
  const bool near = distance < object.thickness + std::min(reach, kMostRadii * object.radius);
  const bool held = first.held && second.held;
  if (near && !held) pair.swapped |= pair.apart;
  pair.apart |= held && !pair.together;
}

void SwapWatch::update(std::span<const PoseTrackPtr> tracks) {
  if (pairs_.empty()) return;
  Time now = Time::min();
  for (const PoseTrackPtr& track : tracks) {
    if (!track->empty()) now = std::max(now, track->newest().time);
  }
  for (size_t i = 0; i < objects_.size(); ++i) {
    if (objects_[i].kind < 0) continue;
    const Seen seen = look(i, *tracks[i], now);
    if (seen.held || !seen_[i].known) held_at_[i] = now;
    seen_[i] = seen;
    seen_[i].unheld = now - held_at_[i];
  }
  std::fill(suspected_.begin(), suspected_.end(), false);
  for (Pair& pair : pairs_) {
    compare(seen_[pair.first], seen_[pair.second], pair);
    if (!pair.swapped && !pair.together) continue;
    suspected_[pair.first] = suspected_[pair.second] = true;
  }
}

void SwapWatch::forget(ObjectId object) {
  for (Pair& pair : pairs_) {
    if (pair.first == object.index() || pair.second == object.index()) {
      pair = {pair.first, pair.second};
    }
  }
}

}  // namespace sightline
