// SPDX-License-Identifier: Apache-2.0
// Checks of what is followed: by its shape, or by its print.
#include <utility>

#include "sightline/base/log.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/search_cost.hpp"

namespace sightline {

bool ObjectSearch::check_due(const Target& target, Time now,
                             std::span<const PoseTrackPtr> tracks) const {
  const size_t index = target.object.index();
  if (index >= tracks.size() || !tracks[index] || tracks[index]->empty()) return false;
  const TrackState state = tracks[index]->newest().state;
  if (state != TrackState::kTracking && state != TrackState::kDegraded) return false;
  if (target.printed && !target.features) return false;
  SearchWork look;
  look.textures = cameras_.size();
  const Duration pause =
      target.printed ? target.print.pause(search_cost(look)) : target.proof.pause(state);
  return now - target.checked >= pause;
}

// The first look errs now and then, by a turn; so does what comes back into view.
bool ObjectSearch::doubted(const Target& target) {
  if (target.printed) return target.print.suspected();
  return !target.proof.proven() || target.proof.suspected();
}

std::vector<ObjectSearch::Doubt> ObjectSearch::doubts() const {
  std::vector<Doubt> out;
  for (const Target& target : targets_) out.push_back({target.object, doubted(target)});
  return out;
}

void ObjectSearch::check(Target& target, Time now, std::span<const PoseTrackPtr> tracks,
                         std::vector<Observation>& out) {
  target.checked = now;
  ++checks_.done;
  const PoseAt at = tracks[target.object.index()]->at(now);
  if (at.source == PoseSource::kNone) return;
  const Rigid3& pose = at.estimate.world_from_object;
  Detection other =
      target.printed ? check_print(target, pose) : check_shape(target, at.estimate, now, tracks);
  if (other.poses.empty()) return;
  target.found = std::move(other);
  target.refutes = true;
  target.proof.begin(target.found);
  target.print.begin(true);
  ++checks_.refuted;
  log::debug("check: {}: refuted, {:.0f} deg and {:.0f} mm off", target.object.index(),
             57.3 * rotation_angle(pose, target.found.poses.front().world_from_object),
             1e3 * translation_distance(pose, target.found.poses.front().world_from_object));
  hand_out(target, out);
}

void ObjectSearch::check_found() {
  for (Target& target : targets_) {
    if (target.found.poses.empty() || target.printed || target.proof.proven()) continue;
    const DetectedPose& found = target.found.poses.front();
    target.checked = target.found.time;
    ++checks_.done;
    const OrientationComparison compared = target.detector->compare_orientations(
        found.world_from_object, found.twist, target.found.time, target.colors.get());
    log::debug(
        "check: {} as found: rank {:.2f}, nearby {:.2f}, colors {}; score {:.2f}, turned "
        "{:.2f}",
        target.object.index(), compared.rank, compared.fitted_rank,
        compared.shows_colors ? "show" : "do not", compared.here, compared.other);
    target.proof.shown_as_found(*target.views, found.world_from_object, compared);
  }
}

Detection ObjectSearch::check_print(Target& target, const Rigid3& pose) {
  feature_work_.textures += cameras_.size();
  Detection found = by_features(target, target.features->propose());
  const bool is_elsewhere = target.print.refuted_by(*target.views, pose, found);
  return is_elsewhere ? std::move(found) : Detection();
}

Detection ObjectSearch::check_shape(Target& target, const PoseEstimate& estimate, Time now,
                                    std::span<const PoseTrackPtr> tracks) {
  const Rigid3& pose = estimate.world_from_object;
  target.proof.count();
  OrientationComparison compared =
      target.detector->compare_orientations(pose, estimate.twist, now, target.colors.get());
  log::debug("check: {} at {}: rank {:.2f}, nearby {:.2f}, colors {}; score {:.2f}, turned {:.2f}",
             target.object.index(), now.time_since_epoch().count(), compared.rank,
             compared.fitted_rank, compared.shows_colors ? "show" : "do not", compared.here,
             compared.other);
  if (compared.here == 0 && compared.other == 0) {  // nowhere to be seen: nothing to hold back
    target.proof.let_pass();
    return {};
  }
  if (now - target.last >= target.pause && doubles(target, pose, now, tracks)) {
    return look_for_double(target, now);
  }
  if (target.proof.refuted_by(*target.views, pose, compared)) {
    return target.policy.by_outline(std::move(compared.best), target.colors.get());
  }
  if (target.proof.take_doubts()) {  // it may be covered; then nothing is found elsewhere
    Detection other = look_everywhere(target);
    if (!other.poses.empty() && differs(target, pose, other)) return other;
    target.proof.begin_weakly();  // nothing is claimed until a check finds it there again
  } else if (target.proof.wants_search(compared, now)) {
    search_about(target, estimate, compared, now);
  }
  return {};
}

// A right pose comes out of a search that knows nothing of it; one that only its track comes to
// does not.
void ObjectSearch::search_about(Target& target, const PoseEstimate& pose,
                                const OrientationComparison& compared, Time now) {
  const PlaceSearch search =
      target.detector->search_about(pose.world_from_object, pose.twist, now, target.colors.get());
  log::debug("check: {} at {}: about its place {} of rank {:.2f}, the next has {:.2f} of that",
             target.object.index(), now.time_since_epoch().count(),
             search.same ? "the same" : "another", search.rank, search.second);
  target.proof.note_search(search, compared, now);
}

}  // namespace sightline
