// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cell/cell_parts.hpp"
#include "cell/cell_tracks.hpp"
#include "sightline/publish/cell/cell_bid.hpp"
#include "sightline/publish/cell/hand_over.hpp"
#include "sightline/publish/cell/track_follower.hpp"

namespace sightline {

/// The neighboring cells, as a host that keeps the estimates sees them: which of the cells
/// publishes each object, and what this host shows of those that another one publishes. On the
/// cell's thread.
class CellNeighbors {
 public:
  CellNeighbors(const CellParts& parts, const CellIdentity& self, Registry& registry);

  void on_claim(std::string_view cell, const CellHostState& claim, Time now);
  void on_track(std::string_view cell, std::string_view topic, std::string_view payload,
                const ClockWatch& clock, Time now);
  void on_bid(std::string_view cell, std::string_view topic, std::string_view payload,
              const ClockWatch& clock, Time now);
  /// A camera whose observations are fused here sees the object.
  void note_seen(ObjectId object, Time now) { objects_.at(object.index()).seen = now; }

  /// Decides, shows and bids. `own`: this host's estimates, by ObjectId; `leads`: they are the
  /// cell's. Without a client the neighbors hear nothing.
  void step(const std::vector<PoseTrackPtr>& own, bool leads, MqttClient* client,
            const ClockWatch& clock, Time now);
  /// Whether this host's estimate of a frame captured then is the one to publish.
  bool publishes(ObjectId object, Time capture) const;
  bool holds(ObjectId object) const { return objects_[object.index()].hand.own().holds; }
  uint64_t term(ObjectId object) const { return objects_[object.index()].hand.own().term; }
  /// This host's own estimate is what is shown here.
  bool shows_own(ObjectId object) const { return objects_[object.index()].shows_own; }
  /// Newest capture time of what a neighbor has published.
  Time published(ObjectId object) const { return objects_[object.index()].published; }

  /// By ObjectId: the cell that keeps it; empty: none.
  std::vector<std::string> holders() const;
  std::string fusion(std::string_view cell) const;

 private:
  struct Object {
    HandOver hand;
    TrackFollower follower;
    bool shows_own = true;
    PoseTrackPtr shown{};
    Time published{}, seen{}, adopted{};
    Time next_bid{};
    std::string holder{};  // as the log has it
  };
  struct Neighbor {
    CellTracks tracks;
    std::vector<uint64_t> bids;  // by ObjectId: the newest sequence
  };
  Neighbor* find(std::string_view cell);
  CellVerdict judge(const Neighbor& neighbor, std::string_view topic, const CellBid& bid,
                    const ClockWatch& clock, Time now, size_t& object) const;
  void show(Object& object, const PoseTrackPtr& own, Time now);
  void follow(Object& object, const PoseEstimate& estimate);
  void adopt(Object& object, const PoseTrackPtr& own, Time now);
  void bid(size_t index, MqttClient& client, const ClockWatch& clock, Time now);
  void tell_holder(size_t index);

  const CellParts& parts_;
  const CellIdentity self_;
  const CellTopics topics_;
  std::vector<Neighbor> neighbors_;
  std::vector<Object> objects_;  // by ObjectId
  uint64_t sequence_ = 0;
  CellCounters tracks_, bids_;
  Counter &sent_, &changes_, &adopted_;
};

}  // namespace sightline
