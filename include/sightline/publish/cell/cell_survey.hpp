// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/publish/cell/cell_messages.hpp"

namespace sightline {

/// How a cell looks to somebody who listens at its broker for a while. Passive.
class CellSurvey {
 public:
  struct Host {
    CellHostState state;
    bool fuses = false;  ///< it has said that it keeps the estimates, and goes on saying it
  };
  struct Camera {
    std::string host;  ///< that sends for it
    uint64_t observations = 0;
    Duration oldest{0};  ///< from capture to here, by the clocks of both hosts
  };
  struct Object {
    uint64_t tracks = 0;
    TrackState state = TrackState::kSearching;
    std::vector<std::string> cameras;  ///< of the newest: whose measurements were accepted
  };

  struct Neighbor {
    std::string fusion;  ///< the host that keeps its estimates; empty: nobody has said so twice
    uint64_t boot = 0, beat = 0;       ///< of the newest claim
    std::map<std::string, bool> bids;  ///< by object that both see: whether it publishes it
  };

  /// `neighbors`: cells next to it, whose topics the broker has too.
  explicit CellSurvey(std::string cell, const std::vector<std::string>& neighbors = {})
      : topics_(std::move(cell)) {
    for (const std::string& neighbor : neighbors) neighbors_[neighbor] = {};
  }

  std::vector<MqttSession::Subscription> subscriptions() const;
  /// A message, received at `now_utc_ns`.
  void hear(std::string_view topic, std::string_view payload, int64_t now_utc_ns);

  const std::map<std::string, Host>& hosts() const { return hosts_; }
  const std::map<std::string, Camera>& cameras() const { return cameras_; }
  const std::map<std::string, Object>& objects() const { return objects_; }
  const std::map<std::string, Neighbor>& neighbors() const { return neighbors_; }
  /// Who keeps the estimates; empty: nobody has said so twice.
  std::string fusion() const;
  /// What became of other hosts' observations, by CellVerdict; empty: the fusion host did not say.
  const std::vector<uint64_t>& verdicts() const { return verdicts_; }
  uint64_t malformed() const { return malformed_; }
  /// What a person should look after, a sentence each; empty: the cell is whole.
  std::vector<std::string> faults() const;

 private:
  void hear_host(std::string_view topic, std::string_view payload);
  void hear_claim(std::string_view payload);
  bool hear_neighbor(std::string_view topic, std::string_view payload);
  void hear_claim_of(Neighbor& neighbor, std::string_view payload);
  void hear_bid(const CellTopics& topics, std::string_view topic, std::string_view payload,
                Neighbor& neighbor);

  const CellTopics topics_;
  std::map<std::string, Host> hosts_;
  std::map<std::string, Camera> cameras_;
  std::map<std::string, Object> objects_;
  std::map<std::string, Neighbor> neighbors_;
  std::optional<CellHostState> claim_;
  std::vector<uint64_t> verdicts_;
  uint64_t malformed_ = 0;
};

}  // namespace sightline
