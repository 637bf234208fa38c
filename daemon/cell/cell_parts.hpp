// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "sightline/base/counters.hpp"
#include "sightline/pipeline/track_board.hpp"
#include "sightline/publish/cell/cell_messages.hpp"
#include "sightline/publish/cell/cell_order.hpp"
#include "sightline/publish/cell/clock_watch.hpp"
#include "sightline/publish/cell/observation_gate.hpp"
#include "web/pose_feed.hpp"
#include "workers/fusion_worker.hpp"

namespace sightline {

/// What a daemon brings to its cell.
struct CellParts {
  CellOptions options;
  std::vector<CellHostState::Camera> cameras;  ///< this host's, by CameraId
  FeedNames names;                             ///< cameras: this host's, then the other hosts'
  MotionNoise noise;
  std::shared_ptr<TrackBoard> board;  ///< what is shown here
  /// What this host estimates; the same board unless there are neighbors, or a local estimate.
  std::shared_ptr<TrackBoard> own_board;
  std::shared_ptr<FusionWorker> fusion;
  /// Hears of estimates that come from another host, on the cell's thread; must not block.
  FusionWorker::OnEstimate on_estimate;
  /// Does what an operator ordered at another host, on the cell's thread; must not block.
  std::function<void(const CellOrder&)> on_order;
};

/// Who this daemon is, to the others.
struct CellIdentity {
  std::string host;
  uint64_t boot = 0;         ///< by chance, another one after each start
  int64_t since_utc_ns = 0;  ///< this start
};

/// What came of what arrived, for metrics and status.
using CellCounters = std::array<Counter*, kCellVerdicts>;
CellCounters cell_counters(Registry& registry, const char* what);

}  // namespace sightline
