// SPDX-License-Identifier: Apache-2.0
// Searches for one of several objects that look the same: where the others are, and when two of
// them are said to be at one place.
#include <algorithm>
#include <cmath>

#include "sightline/pipeline/object_search.hpp"

namespace sightline {
namespace {

constexpr Duration kArriving = std::chrono::milliseconds(500);  // from handed out to its track

}  // namespace

// Of other meshes nothing is taken: where one of those is believed by mistake, this one may be.
void ObjectSearch::set_others(Target& target, Time now, std::span<const PoseTrackPtr> tracks) {
  std::vector<KnownObject> known;
  size_t alike = 0;
  for (const Target& other : targets_) {
    if (&other == &target || !look_alike(target, other)) continue;
    const double age = to_seconds(now - other.handed_at);
    if (!missing(other, now, tracks)) {
      const PoseAt at = tracks[other.object.index()]->at(now);
      if (at.source == PoseSource::kNone) continue;
      known.push_back({other.views.get(), at.estimate.world_from_object});
    } else if (other.handed && std::abs(age) < to_seconds(kArriving)) {
      const Rigid3 moved = Rigid3::exp(other.handed->twist * age);
      known.push_back({other.views.get(), other.handed->world_from_object * moved});
    } else {
      ++alike;
    }
  }
  target.detector->set_others(std::move(known), alike);
}

bool ObjectSearch::look_alike(const Target& a, const Target& b) {
  return a.alike.kind >= 0 && a.alike.kind == b.alike.kind;
}

bool ObjectSearch::doubles(const Target& target, const Rigid3& pose, Time now,
                           std::span<const PoseTrackPtr> tracks) const {
  const Eigen::Vector3d place = pose * target.alike.center;
  return std::any_of(targets_.begin(), targets_.end(), [&](const Target& other) {
    if (&other == &target || !look_alike(target, other)) return false;
    if (other.handed_at > target.handed_at || missing(other, now, tracks)) return false;
    const PoseAt at = tracks[other.object.index()]->at(now);
    return at.source != PoseSource::kNone &&
           (at.estimate.world_from_object * other.alike.center - place).norm() <
               target.alike.thickness;
  });
}

// Its cost is bounded like that of what is missing: the two may stay at one place for ever.
Detection ObjectSearch::look_for_double(Target& target, Time now) {
  const SearchWork before = work();
  Detection out = look_everywhere(target);
  SearchWork done = work();
  done -= before;
  target.last = now;
  target.pause = pause_after(target, now, done);
  return out;
}

}  // namespace sightline
