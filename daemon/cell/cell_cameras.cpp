// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_cameras.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"
#include "sightline/publish/cell/hand_over.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTermLasts = 1s;  // of a cell that publishes an object no more
// A fusion host that says nothing for longer is away: it has said every second that it is there.
constexpr Duration kAwayAfter = 2500ms;
constexpr Duration kNeighborAway = 2 * PoseTrack::kFreshFor;
// So long may a fusion host that is back take to find what this host sees.
constexpr Duration kTrust = 5s;

}  // namespace

CellCameras::CellCameras(const CellParts& parts, Registry& registry)
    : parts_(parts), counters_(cell_counters(registry, "track")) {
  cells_.emplace_back(parts, parts.options.name);
  for (const std::string& neighbor : parts.options.neighbors) cells_.emplace_back(parts, neighbor);
  for (size_t i = 0; i < parts.names.objects.size(); ++i) {
    objects_.push_back({TrackFollower(ObjectId(static_cast<uint32_t>(i)), parts.noise)});
  }
  if (parts.options.local) local_ = std::make_unique<CellLocal>(parts, registry);
}

CellTracks* CellCameras::find(std::string_view cell) {
  const auto found = std::ranges::find_if(
      cells_, [cell](const CellTracks& tracks) { return tracks.topics().cell == cell; });
  return found == cells_.end() ? nullptr : &*found;
}

std::string CellCameras::fusion(std::string_view cell) const {
  for (const CellTracks& tracks : cells_) {
    if (tracks.topics().cell == cell) return tracks.leader().host();
  }
  return {};
}

std::vector<std::string> CellCameras::holders() const {
  std::vector<std::string> cells;
  for (size_t i = 0; i < objects_.size(); ++i) {
    const bool own = local_ && local_->runs(ObjectId(static_cast<uint32_t>(i)));
    cells.push_back(own ? "" : objects_[i].cell);
  }
  return cells;
}

void CellCameras::on_claim(std::string_view cell, const CellHostState& claim, Time now) {
  CellTracks* const tracks = find(cell);
  if (tracks == nullptr) return;
  (void)tracks->on_claim(claim, now);
  if (tracks == &cells_.front() && claim.online) leader_heard_ = now;
}

void CellCameras::on_track(std::string_view cell, std::string_view topic, std::string_view payload,
                           const ClockWatch& clock, Time now) {
  CellTracks* const tracks = find(cell);
  if (tracks == nullptr) return;
  CellTracks::Taken taken;
  CellVerdict verdict = tracks->read(topic, payload, clock, now, taken);
  if (verdict == CellVerdict::kTaken) {
    const Object& object = objects_[taken.estimate.object.index()];
    const bool over = taken.term < object.term && now - object.heard < kTermLasts;
    if (over) verdict = CellVerdict::kSuperseded;
  }
  counters_[static_cast<size_t>(verdict)]->add();
  if (verdict != CellVerdict::kTaken) return;
  Object& object = objects_[taken.estimate.object.index()];
  object.term = taken.term;
  object.cell = tracks->topics().cell;
  object.heard = now;
  if (tracks == &cells_.front()) leader_heard_ = now;
  const ObjectId id = taken.estimate.object;
  if (local_ && local_->runs(id)) {
    if (!gives_way(taken.estimate)) return;
    give_way(id, taken.estimate.time);
  }
  if (object.follower.take(taken.estimate)) publish(taken.estimate, FusionWorker::Cause::kFrame);
}

void CellCameras::advance(bool connected, Time now) {
  if (begun_ == Time{}) begun_ = now;
  for (CellTracks& tracks : cells_) (void)tracks.leader().advance(now);
  for (size_t i = 0; i < objects_.size(); ++i) {
    if (local_) advance_local(ObjectId(static_cast<uint32_t>(i)), connected, now);
    if (local_ && local_->runs(ObjectId(static_cast<uint32_t>(i)))) continue;
    if (const auto estimate = objects_[i].follower.advance(now)) {
      publish(*estimate, FusionWorker::Cause::kSilence);
    }
  }
  if (!local_) return;
  for (const auto& [estimate, cause] : local_->take()) parts_.on_estimate(estimate, cause);
}

bool CellCameras::is_away(const Object& object, bool connected, Time now) const {
  if (leader_heard_ == Time{} && now - begun_ < kAwayAfter) return false;  // it has just begun
  const bool neighbors = !object.cell.empty() && object.cell != cells_.front().topics().cell;
  if (connected && neighbors && now - object.heard <= kNeighborAway) return false;
  return !connected || cells_.front().leader().host().empty() || now - leader_heard_ > kAwayAfter;
}

// The cell's estimate is begun anew, and better than this host's only when it is sure of itself.
bool CellCameras::gives_way(const PoseEstimate& estimate) const {
  if (estimate.state == TrackState::kTracking) return true;
  const PoseTrackPtr own = local_->track(estimate.object);
  return estimate.state == TrackState::kDegraded &&
         (own->empty() || own->newest().state != TrackState::kTracking);
}

void CellCameras::give_way(ObjectId id, Time end) {
  Object& object = objects_[id.index()];
  object.follower.restart(local_->track(id).get(), end);
  object.shown.reset();
  object.back.reset();
  local_->end(id);
  log::info({.object = parts_.names.objects[id.index()], .cause = "cell"},
            "cell: {}: the cell's estimate is followed again", parts_.names.objects[id.index()]);
}

void CellCameras::advance_local(ObjectId id, bool connected, Time now) {
  Object& object = objects_[id.index()];
  const bool away = is_away(object, connected, now);
  if (!local_->runs(id)) {
    if (!away) return;
    local_->begin(id, object.follower.track());
    log::warning({.object = parts_.names.objects[id.index()], .cause = "cell"},
                 "cell: {}: nobody keeps the cell's estimates: this host goes on by itself (local)",
                 parts_.names.objects[id.index()]);
  }
  if (away) {
    object.back.reset();
  } else if (!object.back) {
    object.back = now;
  } else if (now - *object.back > kTrust) {
    give_way(id, now);
    return parts_.board->publish(id, object.follower.track());
  }
  const PoseTrackPtr own = local_->track(id);
  if (own == object.shown) return;
  const bool has = !own->empty() && has_pose(own->newest().state);
  if (!has && object.shown == nullptr) {  // what was shown before is all there is
    if (const auto estimate = object.follower.advance(now)) {
      publish(*estimate, FusionWorker::Cause::kSilence);
    }
    return;
  }
  object.shown = own;
  parts_.board->publish(id, own);
}

void CellCameras::publish(const PoseEstimate& estimate, FusionWorker::Cause cause) {
  parts_.board->publish(estimate.object, objects_[estimate.object.index()].follower.track());
  parts_.on_estimate(estimate, cause);
}

}  // namespace sightline
