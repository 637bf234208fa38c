// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string_view>
#include <vector>

#include "cell/cell_neighbors.hpp"
#include "cell/cell_parts.hpp"
#include "cell/estimate_queue.hpp"
#include "cell/fusion_claim.hpp"
#include "sightline/publish/cell/observation_gate.hpp"

namespace sightline {

/// The part of a host that keeps the estimates: observations of other hosts in, tracks out. On the
/// cell's thread, but for push().
class CellFusion {
 public:
  CellFusion(const CellParts& parts, const CellIdentity& self, Registry& registry);

  /// Observations of other hosts since the start, by CellVerdict.
  std::vector<uint64_t> verdicts() const;
  FusionClaim& claim() { return claim_; }
  const FusionClaim& claim() const { return claim_; }

  /// Null: there are none.
  CellNeighbors* neighbors() { return neighbors_.get(); }

  /// An estimate of the fusion thread; never waits. Those of frames are read from the board.
  void push(const PoseEstimate& estimate, FusionWorker::Cause cause);
  /// `cell`: whose topic it is, as CellOptions::neighbors; empty: this cell's.
  void on_observation(std::string_view cell, std::string_view topic, std::string_view payload,
                      const ClockWatch& clock, Time now);
  /// Publishes what is new; without a client it is let go.
  void step(MqttClient* client, const ClockWatch& clock, Time now);
  /// Nobody is heard any more.
  void end_doubts();

 private:
  void count(CellVerdict verdict, const std::string& camera);
  void note_doubt(const CellObservation& observation, ObjectId object, Time now);
  void end_old_doubts(Time now);
  void publish_new(size_t object, MqttClient& client, const ClockWatch& clock);
  void pass_on(MqttClient* client, const ClockWatch& clock);
  void publish(const PoseEstimate& estimate, MqttClient& client, const ClockWatch& clock);
  void publish_last(MqttClient& client, Time now);

  const CellParts& parts_;
  const CellIdentity self_;
  const CellTopics topics_;
  FusionClaim claim_;
  ObservationGate gate_;
  std::vector<LatencyHistogram*> latencies_;  // by CameraId
  CellCounters counters_;
  Counter &published_, &refused_;
  std::vector<std::pair<std::string, CellVerdict>> told_;  // cameras whose refusal the log has
  uint64_t sequence_ = 0;

  /// Which hosts doubt an object's pose, and when they last said so.
  std::vector<std::map<std::string, Time>> doubts_;  // by ObjectId
  EstimateQueue estimates_;
  std::vector<PoseTrackPtr> tracks_, sent_;  // by ObjectId
  std::vector<Time> sent_until_;             // by ObjectId, of estimates that anybody published
  std::unique_ptr<CellNeighbors> neighbors_;
  Time next_last_{};
};

}  // namespace sightline
