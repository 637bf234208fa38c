// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <mutex>
#include <vector>

#include "cell/cell_parts.hpp"

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

  struct Estimate {
    PoseEstimate estimate;
    FusionWorker::Cause cause;
  };
  /// Of objects that run, since the last call.
  std::vector<Estimate> take();

 private:
  void note();

  const CellParts& parts_;
  std::vector<char> runs_;  // by ObjectId
  std::atomic<bool> fed_ = false;
  std::vector<Gauge*> shown_;  // by ObjectId
  std::mutex mutex_;           // guards estimates_
  std::vector<Estimate> estimates_;
};

}  // namespace sightline
