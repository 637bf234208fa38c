// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_neighbors.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kSeenLasts = 200ms;
constexpr Duration kAdoptEvery = 200ms;
constexpr Duration kFresh = 100ms;  // of an estimate that is taken over

EstimateWorth worth_of(const PoseTrackPtr& track) {
  return track == nullptr || track->empty() ? EstimateWorth() : worth_of(track->newest());
}

}  // namespace

CellNeighbors::CellNeighbors(const CellParts& parts, const CellIdentity& self, Registry& registry)
    : parts_(parts),
      self_(self),
      topics_(parts.options.name),
      tracks_(cell_counters(registry, "track")),
      bids_(cell_counters(registry, "bid")),
      sent_(registry.counter("sightline_cell_bids_sent_total",
                             "What neighboring cells were told of objects")),
      changes_(registry.counter("sightline_cell_handovers_total",
                                "Times that an object went to another cell or came from one")),
      adopted_(registry.counter("sightline_cell_adopted_total",
                                "Times that a neighbor's estimate was where this cell began")) {
  const size_t objects = parts.names.objects.size();
  for (const std::string& cell : parts.options.neighbors) {
    neighbors_.push_back({CellTracks(parts, cell), std::vector<uint64_t>(objects)});
  }
  for (size_t i = 0; i < objects; ++i) {
    objects_.push_back({HandOver(parts.options.name),
                        TrackFollower(ObjectId(static_cast<uint32_t>(i)), parts.noise)});
  }
}

CellNeighbors::Neighbor* CellNeighbors::find(std::string_view cell) {
  const auto found = std::ranges::find_if(
      neighbors_, [cell](const Neighbor& n) { return n.tracks.topics().cell == cell; });
  return found == neighbors_.end() ? nullptr : &*found;
}

std::string CellNeighbors::fusion(std::string_view cell) const {
  for (const Neighbor& neighbor : neighbors_) {
    if (neighbor.tracks.topics().cell == cell) return neighbor.tracks.leader().host();
  }
  return {};
}

std::vector<std::string> CellNeighbors::holders() const {
  std::vector<std::string> cells;
  for (const Object& object : objects_) cells.push_back(object.hand.holder());
  return cells;
}

bool CellNeighbors::publishes(ObjectId object, Time capture) const {
  return objects_[object.index()].hand.publishes(capture);
}

void CellNeighbors::on_claim(std::string_view cell, const CellHostState& claim, Time now) {
  Neighbor* const neighbor = find(cell);
  if (neighbor == nullptr) return;
  const CellLeader::News news = neighbor->tracks.on_claim(claim, now);
  if (news == CellLeader::News::kNone) return;
  std::ranges::fill(neighbor->bids, 0);
  if (news != CellLeader::News::kGone) return;
  for (Object& object : objects_) object.hand.gone(std::string(cell));
}

CellVerdict CellNeighbors::judge(const Neighbor& neighbor, std::string_view topic,
                                 const CellBid& bid, const ClockWatch& clock, Time now,
                                 size_t& object) const {
  const auto& objects = parts_.names.objects;
  object = static_cast<size_t>(std::ranges::find(objects, bid.object) - objects.begin());
  if (topic != neighbor.tracks.topics().bid(bid.object) || object == objects.size() ||
      !neighbor.tracks.leader().is(bid.boot)) {
    return CellVerdict::kForeign;
  }
  if (!clock.state(now).fit) return CellVerdict::kClock;
  const Duration age(clock.utc_ns_of(now) - bid.time_utc_ns);
  if (age > HandOver::kSilence) return CellVerdict::kLate;
  if (-age > parts_.options.clock_limit + parts_.options.age_limit) return CellVerdict::kFuture;
  return bid.sequence > neighbor.bids[object] ? CellVerdict::kTaken : CellVerdict::kDuplicate;
}

void CellNeighbors::on_bid(std::string_view cell, std::string_view topic, std::string_view payload,
                           const ClockWatch& clock, Time now) {
  Neighbor* const neighbor = find(cell);
  if (neighbor == nullptr) return;
  const auto bid = decode_bid(payload);
  size_t object = 0;
  const CellVerdict verdict =
      bid ? judge(*neighbor, topic, *bid, clock, now, object) : CellVerdict::kMalformed;
  bids_[static_cast<size_t>(verdict)]->add();
  if (verdict != CellVerdict::kTaken) return;
  neighbor->bids[object] = bid->sequence;
  Holding said;
  said.worth = {bid->state, bid->sigma};
  said.holds = bid->holds;
  said.term = bid->term;
  said.next = bid->next;
  if (bid->from_utc_ns != 0) said.from = clock.time_of(bid->from_utc_ns);
  if (bid->until_utc_ns != 0) said.until = clock.time_of(bid->until_utc_ns);
  objects_[object].hand.hear(neighbor->tracks.topics().cell, said, now);
}

void CellNeighbors::on_track(std::string_view cell, std::string_view topic,
                             std::string_view payload, const ClockWatch& clock, Time now) {
  Neighbor* const neighbor = find(cell);
  if (neighbor == nullptr) return;
  CellTracks::Taken taken;
  CellVerdict verdict = neighbor->tracks.read(topic, payload, clock, now, taken);
  if (verdict == CellVerdict::kTaken) {
    const HandOver& hand = objects_[taken.estimate.object.index()].hand;
    if (hand.own().holds && taken.term < hand.own().term) verdict = CellVerdict::kSuperseded;
  }
  tracks_[static_cast<size_t>(verdict)]->add();
  if (verdict != CellVerdict::kTaken) return;
  Object& object = objects_[taken.estimate.object.index()];
  object.hand.hear_estimate(neighbor->tracks.topics().cell, taken.estimate.time, now);
  object.published = std::max(object.published, taken.estimate.time);
  if (!object.hand.own().holds) follow(object, taken.estimate);
}

// What is drawn goes on without a step in time: what was shown so far, then the neighbor's.
void CellNeighbors::follow(Object& object, const PoseEstimate& estimate) {
  if (object.shows_own) {
    object.follower.restart(object.shown.get(), estimate.time);
    object.shows_own = false;
  }
  if (!object.follower.take(estimate)) return;
  parts_.board->publish(estimate.object, object.follower.track());
  parts_.on_estimate(estimate, FusionWorker::Cause::kFrame);
}

void CellNeighbors::show(Object& object, const PoseTrackPtr& own, Time now) {
  if (object.hand.own().holds) object.shows_own = true;
  if (object.shows_own) {
    if (own == nullptr || own == object.shown) return;
    object.shown = own;
    parts_.board->publish(own->object(), own);
    return;
  }
  object.shown.reset();
  if (const auto estimate = object.follower.advance(now)) {
    parts_.board->publish(estimate->object, object.follower.track());
    parts_.on_estimate(*estimate, FusionWorker::Cause::kSilence);
  }
}

// An object that comes from a neighbor is not found anew: what that knows of it is where this cell
// begins, as soon as a camera of it sees the object there.
void CellNeighbors::adopt(Object& object, const PoseTrackPtr& own, Time now) {
  if (object.shows_own || now - object.seen > kSeenLasts || now - object.adopted < kAdoptEvery) {
    return;
  }
  if (own != nullptr && !own->empty() && has_pose(own->newest().state)) return;
  PoseTrackPtr track = object.follower.track();
  if (track->empty() || !is_measured(track->newest().state)) return;
  if (now - track->newest().time > kFresh) return;
  object.adopted = now;
  adopted_.add();
  parts_.fusion->adopt(std::move(track));
}

void CellNeighbors::step(const std::vector<PoseTrackPtr>& own, bool leads, MqttClient* client,
                         const ClockWatch& clock, Time now) {
  for (Neighbor& neighbor : neighbors_) {
    if (neighbor.tracks.leader().advance(now) != CellLeader::News::kGone) continue;
    for (Object& object : objects_) object.hand.gone(neighbor.tracks.topics().cell);
  }
  for (size_t i = 0; i < objects_.size() && i < own.size(); ++i) {
    Object& object = objects_[i];
    if (leads) {
      const auto utc = static_cast<uint64_t>(std::max<int64_t>(clock.utc_ns_of(now), 0));
      if (object.hand.step(worth_of(own[i]), now, utc)) object.next_bid = now;
      adopt(object, own[i], now);
    }
    show(object, own[i], now);
    tell_holder(i);
    if (!leads || client == nullptr || now < object.next_bid) continue;
    object.next_bid = now + HandOver::kSayEvery;
    bid(i, *client, clock, now);
  }
}

void CellNeighbors::bid(size_t index, MqttClient& client, const ClockWatch& clock, Time now) {
  const Holding& own = objects_[index].hand.own();
  CellBid bid;
  bid.object = parts_.names.objects[index];
  bid.host = self_.host;
  bid.boot = self_.boot;
  bid.sequence = ++sequence_;
  bid.time_utc_ns = clock.utc_ns_of(now);
  bid.state = own.worth.state;
  bid.sigma = own.worth.sigma;
  bid.holds = own.holds;
  bid.term = own.term;
  bid.next = own.next;
  if (own.from != Time{}) bid.from_utc_ns = clock.utc_ns_of(own.from);
  if (own.until != Time::max()) bid.until_utc_ns = clock.utc_ns_of(own.until);
  if (client.publish(topics_.bid(bid.object), encode(bid), false)) sent_.add();
}

void CellNeighbors::tell_holder(size_t index) {
  Object& object = objects_[index];
  std::string holder = object.hand.holder();
  if (holder.empty() || holder == object.holder) return;
  if (!object.holder.empty()) changes_.add();
  log::info({.object = parts_.names.objects[index], .cause = "cell"}, "cell: {}: cell {} has it",
            parts_.names.objects[index], holder);
  object.holder = std::move(holder);
}

}  // namespace sightline
