// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <vector>

#include "cell/cell_parts.hpp"
#include "cell/estimate_queue.hpp"

namespace sightline {

/// A camera host's own estimates, of what its own cameras see, while nobody keeps the cell's: for
/// its own streams and clients, never for the cell. On the cell's thread, but for push().
class CellLocal {
 public:
  CellLocal(const CellParts& parts, Registry& registry);

  /// One of this host's observations; any thread, never waits.
  void push(const Observation& observation);
  /// An estimate of the fusion thread; never waits.
  void push(const PoseEstimate& estimate, FusionWorker::Cause cause);

  /// Goes on with `last`, if that has a pose.
  void begin(ObjectId object, PoseTrackPtr last);
  void end(ObjectId object);
  bool runs(ObjectId object) const { return runs_[object.index()]; }
  /// By ObjectId.
  std::vector<bool> running() const { return {runs_.begin(), runs_.end()}; }
  /// Never null.
  PoseTrackPtr track(ObjectId object) const;

  /// Of objects that run, since the last call.
  std::vector<QueuedEstimate> take();

 private:
  void note();

  const CellParts& parts_;
  std::vector<char> runs_;  // by ObjectId
  std::atomic<bool> fed_ = false;
  std::vector<Gauge*> shown_;  // by ObjectId
  EstimateQueue estimates_;
};

}  // namespace sightline
