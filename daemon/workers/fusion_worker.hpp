// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/bounded_queue.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/model/stream_types.hpp"
#include "sightline/pipeline/object_fusion.hpp"

namespace sightline {

/// The thread that runs the estimators: takes observations of all cameras in the order they come,
/// publishes tracks. Capture, observe and render never wait for it.
class FusionWorker {
 public:
  /// What made an estimate: a camera's frame, or the time that passed without one (or a forget()).
  enum class Cause { kFrame, kSilence };
  using OnEstimate = std::function<void(const PoseEstimate&, Cause)>;

  /// `shape_symmetry`: by object. `on_estimate` (may be empty) hears of every estimate, and of
  /// every change of state, on the fusion thread; it must not block.
  static Result<std::unique_ptr<FusionWorker>> start(
      const EstimatorOptions& options, const std::vector<NamedObject>& objects,
      const std::vector<ShapeSymmetry>& shape_symmetry, const std::vector<AlikeObject>& alike,
      std::shared_ptr<TrackBoard> board, std::unique_ptr<CalibrationWatch> watch,
      Registry& registry, HeartbeatBoard& beats, OnEstimate on_estimate);
  ~FusionWorker() { stop(); }

  /// Takes one frame's observation; from any thread, never waits. `latency` (may be null) gets its
  /// age when it has been fused.
  void push(Observation observation, LatencyHistogram* latency = nullptr);
  /// What a camera's look at its room says; from any thread, never waits.
  void push(SceneLook look);
  /// Who can doubt an object's pose, each for itself: one that does is enough.
  enum class Doubt : uint8_t { kSearch = 1, kOtherHosts = 2 };
  /// ObjectEstimator::set_doubted() for the observations from now on; from any thread, never waits.
  void set_doubted(ObjectId object, bool doubted, Doubt by = Doubt::kSearch);
  /// Drops what is known of an object, a moment later; from any thread, never waits.
  void forget(ObjectId object);
  /// Goes on with another host's track of an object that has no pose here (ObjectFusion::adopt()),
  /// a moment later; from any thread, never waits. Null is ignored.
  void adopt(PoseTrackPtr track);
  /// What the cameras' places are believed to be, by CameraId; null: nobody watches, or nothing is
  /// known yet. Any thread.
  std::shared_ptr<const std::vector<CameraWatch>> calibration() const {
    return calibration_.read();
  }
  /// Calibrated places, by CameraId, a moment later; from any thread, never waits.
  void set_cameras(std::vector<std::optional<Rigid3>> world_from_camera);
  void stop();
  /// The most observations that waited at once since the last call. Any thread.
  size_t queue_peak() { return queue_.take_peak(); }

 private:
  FusionWorker(std::unique_ptr<ObjectFusion> fusion, const std::vector<NamedObject>& objects,
               Registry& registry, OnEstimate on_estimate);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  void take(const Observation& observation, LatencyHistogram* latency);
  void forget_those_named();
  void adopt_those_given();
  void take_cameras();
  void take_scene_looks();
  void publish_calibration();
  void tell_of_silence(ObjectId object);

  struct ObjectCounters {
    Counter* accepted;
    Counter* gated;
    Counter* late;
    Gauge* state;
    Gauge* residual;
    std::vector<Gauge*> degraded_reasons;  ///< by bit
  };
  /// Why an object is degraded, and whether the log has it.
  struct ReasonLog {
    std::string object;
    Time since{};
    DegradedReasons now, said;
  };
  static void log_reasons(const PoseEstimate& estimate, ReasonLog& log);

  std::unique_ptr<ObjectFusion> fusion_;
  OnEstimate on_estimate_;
  struct Item {
    Observation observation;
    LatencyHistogram* latency;
  };
  BoundedQueue<Item> queue_{256};
  Snapshot<const std::vector<CameraWatch>> calibration_;
  std::mutex mutex_;  // guards the four below
  std::optional<std::vector<std::optional<Rigid3>>> next_cameras_;
  std::vector<ObjectId> forget_;
  std::vector<PoseTrackPtr> adopt_;
  std::vector<SceneLook> scene_looks_;
  Counter& dropped_;
  std::vector<std::atomic<uint8_t>> doubted_;  // by ObjectId: bits of Doubt
  std::vector<ObjectCounters> counters_;
  std::vector<ReasonLog> reason_logs_;
  std::jthread thread_;
};

}  // namespace sightline
