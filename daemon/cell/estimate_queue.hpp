// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <vector>

#include "workers/fusion_worker.hpp"

namespace sightline {

/// An estimate of the fusion thread.
struct QueuedEstimate {
  PoseEstimate estimate;
  FusionWorker::Cause cause;
};

/// Estimates on their way from the fusion thread to the cell's. Neither waits for the other; what
/// does not fit is let go. Any thread.
class EstimateQueue {
 public:
  void push(const PoseEstimate& estimate, FusionWorker::Cause cause) {
    const std::lock_guard lock(mutex_);
    if (estimates_.size() < kMost) estimates_.push_back({estimate, cause});
  }
  /// Those since the last call.
  std::vector<QueuedEstimate> take() {
    std::vector<QueuedEstimate> estimates;
    const std::lock_guard lock(mutex_);
    estimates.swap(estimates_);
    return estimates;
  }

 private:
  static constexpr size_t kMost = 1024;
  std::mutex mutex_;  ///< guards estimates_
  std::vector<QueuedEstimate> estimates_;
};

}  // namespace sightline
