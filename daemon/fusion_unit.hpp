// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/bounded_queue.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/fuse/estimator.hpp"
#include "sightline/model/stream_types.hpp"
#include "track_board.hpp"

namespace sightline {

/// The thread that runs the estimators: takes observations of all cameras in the order they come,
/// publishes tracks. Capture, observe and render never wait for it.
class FusionUnit {
 public:
  using OnEstimate = std::function<void(const PoseEstimate&)>;

  /// `lookalikes`: by object. `on_estimate` (may be empty) hears of every estimate on the fusion
  /// thread; it must not block.
  static Result<std::unique_ptr<FusionUnit>> start(const EstimatorOptions& options,
                                                   const std::vector<NamedObject>& objects,
                                                   const std::vector<Lookalikes>& lookalikes,
                                                   std::shared_ptr<TrackBoard> board,
                                                   Registry& registry, HeartbeatBoard& beats,
                                                   OnEstimate on_estimate);
  ~FusionUnit() { stop(); }

  /// Takes one frame's observation; from any thread, never waits.
  void push(Observation observation);
  void stop();

 private:
  FusionUnit(std::vector<ObjectEstimator> estimators, const std::vector<NamedObject>& objects,
             std::shared_ptr<TrackBoard> board, Registry& registry, OnEstimate on_estimate);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  void take(const Observation& observation);

  struct ObjectCounters {
    Counter* accepted;
    Counter* gated;
    Counter* late;
    Gauge* state;
    std::vector<Gauge*> doubts;  ///< by bit
  };
  /// Why an object is degraded, and whether the log has it.
  struct Doubted {
    std::string object;
    Time since{};
    Doubts now, said;
  };
  static void say_doubts(const PoseEstimate& estimate, Doubted& doubted);

  std::vector<ObjectEstimator> estimators_;
  std::shared_ptr<TrackBoard> board_;
  OnEstimate on_estimate_;
  BoundedQueue<Observation> queue_{256};
  Counter& dropped_;
  std::vector<ObjectCounters> counters_;
  std::vector<Doubted> doubted_;
  std::jthread thread_;
};

}  // namespace sightline
