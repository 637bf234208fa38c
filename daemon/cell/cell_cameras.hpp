// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cell/cell_local.hpp"
#include "cell/cell_parts.hpp"
#include "cell/cell_tracks.hpp"
#include "sightline/publish/cell/track_follower.hpp"

namespace sightline {

/// Tracks on their way to a host that only takes frames: those of its own cell and, of objects that
/// another cell keeps, its neighbors'; and this host's own where nobody keeps the cell's, if that
/// is wanted. On the cell's thread.
class CellCameras {
 public:
  CellCameras(const CellParts& parts, Registry& registry);

  /// Who keeps a cell's estimates, as it says itself; `cell` as CellOptions::neighbors.
  void on_claim(std::string_view cell, const CellHostState& claim, Time now);
  void on_track(std::string_view cell, std::string_view topic, std::string_view payload,
                const ClockWatch& clock, Time now);
  /// Tells of silence. `connected`: the broker is.
  void advance(bool connected, Time now);
  /// Null: this host has no estimates of its own.
  CellLocal* local() { return local_.get(); }

  /// The host of a cell whose estimates are taken; empty: none is known.
  std::string fusion(std::string_view cell) const;
  /// By ObjectId: the cell whose estimate is the newest; empty: none, or this host's own.
  std::vector<std::string> holders() const;

 private:
  struct Object {
    TrackFollower follower;
    /// Of the estimates that are taken: whose, and when the newest came.
    uint64_t term = 0;
    std::string cell{};
    Time heard{};
    // Of an estimate of this host's own.
    PoseTrackPtr shown{};
    std::optional<Time> back{};  ///< since when somebody keeps the cell's again
  };
  bool is_away(const Object& object, bool connected, Time now) const;
  bool gives_way(const PoseEstimate& estimate) const;
  void give_way(ObjectId id, Time end);
  void advance_local(ObjectId id, bool connected, Time now);
  CellTracks* find(std::string_view cell);
  void publish(const PoseEstimate& estimate, FusionWorker::Cause cause);

  const CellParts& parts_;
  std::vector<CellTracks> cells_;  // the own one first
  std::vector<Object> objects_;    // by ObjectId
  Time begun_{};                   // the first advance()
  Time leader_heard_{};            // anything of the own cell's fusion host
  std::unique_ptr<CellLocal> local_;
  CellCounters counters_;
};

}  // namespace sightline
