// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <optional>
#include <string_view>
#include <vector>

#include "cell/cell_parts.hpp"
#include "cell/fusion_claim.hpp"
#include "sightline/base/bounded_queue.hpp"
#include "sightline/publish/cell/track_follower.hpp"

namespace sightline {

/// The part of a host that only takes frames: observations out, tracks in. On the cell's thread,
/// but for push() and set_doubted().
class CellCameras {
 public:
  CellCameras(const CellParts& parts, const CellIdentity& self, Registry& registry);

  /// Takes one frame's observation, on the thread that made it: it is linearized there. Waits for
  /// nobody.
  void push(const Observation& observation);
  void set_doubted(ObjectId object, bool doubted) { doubted_.at(object.index()) = doubted; }

  /// Who keeps the estimates, as it says itself.
  void on_claim(const CellHostState& claim, Time now);
  void on_track(std::string_view topic, std::string_view payload, const ClockWatch& clock,
                Time now);
  /// Sends what waits; without a client it is let go.
  void send(MqttClient* client, const ClockWatch& clock, Time now);
  /// Tells of silence.
  void advance(Time now);

  /// The host whose estimates are taken; empty: none is known.
  std::string fusion() const { return leader_ ? leader_->host : ""; }

 private:
  struct Item {
    CellObservation observation;
    Time capture;
  };
  CellVerdict judge(std::string_view topic, const CellTrack& track, const ClockWatch& clock,
                    Time now, size_t& object) const;
  void publish(const PoseEstimate& estimate, FusionWorker::Cause cause);

  const CellParts& parts_;
  const CellIdentity self_;
  const CellTopics topics_;
  BoundedQueue<Item> queue_{256};
  std::vector<std::atomic<bool>> doubted_;  // by ObjectId
  std::vector<TrackFollower> followers_;    // by ObjectId
  std::vector<uint64_t> sequences_;         // by ObjectId, of the leader's tracks
  std::optional<CellHostState> leader_;
  Time leader_heard_{};  // the newest claim
  uint64_t sequence_ = 0;
  CellCounters counters_;
  Counter &sent_, &late_, &no_clock_, &no_broker_, &overflow_, &no_pose_;
};

}  // namespace sightline
