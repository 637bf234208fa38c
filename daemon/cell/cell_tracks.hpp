// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cell/cell_leader.hpp"
#include "cell/cell_parts.hpp"

namespace sightline {

/// The estimates of one cell's fusion host, judged and put in this host's terms: its ids, its
/// clock. On the cell's thread.
class CellTracks {
 public:
  /// `cell`: the own one or a neighbor.
  CellTracks(const CellParts& parts, const std::string& cell);

  const CellTopics& topics() const { return topics_; }
  CellLeader& leader() { return leader_; }
  const CellLeader& leader() const { return leader_; }
  CellLeader::News on_claim(const CellHostState& claim, Time now);

  struct Taken {
    PoseEstimate estimate;
    uint64_t term = 0;  ///< of its cell's holding
  };
  /// `taken` means something with kTaken.
  CellVerdict read(std::string_view topic, std::string_view payload, const ClockWatch& clock,
                   Time now, Taken& taken);

  static constexpr Duration kOldest = std::chrono::seconds(1);  ///< is of no use to anybody

 private:
  CellVerdict judge(std::string_view topic, const CellTrack& track, const ClockWatch& clock,
                    Time now, size_t& object) const;

  const CellParts& parts_;
  const CellTopics topics_;
  CellLeader leader_;
  std::vector<uint64_t> sequences_;  // by ObjectId, of the leader's tracks
};

}  // namespace sightline
