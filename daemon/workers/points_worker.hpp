// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/model/stream_types.hpp"
#include "sightline/pipeline/object_points.hpp"
#include "sightline/pipeline/track_board.hpp"

namespace sightline {

/// How far the points of one object lie from its mesh at the estimated pose: a check of the pose by
/// pixels alone.
struct PointCheck {
  Time time{};  ///< of the newest points; 0: none yet
  size_t points = 0, on_object = 0;
  double rms_m = 0, median_m = 0;  ///< of those on the object
  /// The newest reconstructions, with enough points, say that the surface is not where the pose
  /// puts it.
  bool contradicts = false;
};

/// The thread ("points") that reconstructs stereo points of the tracked objects, at its own rate
/// and with low priority: it takes the newest frames, what comes meanwhile is dropped and counted.
class PointsWorker {
 public:
  static constexpr double kRest = 9;  ///< at most a tenth of a core
  /// After a reconstruction the thread rests `rest` times as long as it took.
  static std::unique_ptr<PointsWorker> start(const PointsConfig& config,
                                             std::unique_ptr<ObjectPoints> finder, size_t cameras,
                                             const std::vector<NamedObject>& objects,
                                             std::shared_ptr<TrackBoard> board, Registry& registry,
                                             HeartbeatBoard& beats, double rest = kRest);
  ~PointsWorker() { stop(); }

  /// Takes a frame, which wears the CameraId of the installation; from any thread, never waits.
  void push(const FramePtr& frame);
  void stop();

  /// The newest points, moved to where their objects are at `time`; null: none that are fresh. Any
  /// thread.
  ScenePointsPtr points_at(Time time) const;
  /// By ObjectId. Any thread.
  std::vector<PointCheck> checks() const;

 private:
  PointsWorker(const PointsConfig& config, std::unique_ptr<ObjectPoints> finder, size_t cameras,
               const std::vector<NamedObject>& objects, std::shared_ptr<TrackBoard> board,
               Registry& registry, double rest);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  bool anything_tracked();
  void take_frames();
  void forget();
  void let_go();
  void reconstruct();
  void check(size_t object, const std::vector<ObjectPoints::Found>& found);
  void wait(std::stop_token stop, Duration duration);

  struct Gauges {
    Gauge *points, *rms, *contradicts;
  };

  const PointsConfig config_;
  const double rest_;
  std::atomic<Duration> period_;  // between reconstructions, as it came about
  std::unique_ptr<ObjectPoints> finder_;
  std::shared_ptr<TrackBoard> board_;
  Counter &runs_, &dropped_;
  Gauge& seconds_;
  std::vector<Gauges> gauges_;  // by ObjectId
  std::vector<int> against_;    // reconstructions in a row that contradict
  std::atomic<bool> wanted_{false};
  Snapshot<const std::vector<ObjectPoints::Found>> found_;  // null: nothing that is fresh
  mutable std::mutex mutex_;                                // guards newest_ and checks_
  std::vector<FramePtr> newest_;
  std::vector<PointCheck> checks_;
  std::condition_variable_any never_;
  std::vector<PoseTrackPtr> tracks_;
  std::jthread thread_;
};

}  // namespace sightline
