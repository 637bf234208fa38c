// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/latest_slot.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/pipeline/track_board.hpp"
#include "sightline/pipeline/turning/angle_refiner.hpp"

namespace sightline {

/// What moves before a camera, and where it is.
struct MovingScene {
  std::shared_ptr<const TrackBoard> board;
  std::vector<MovingBox> boxes;
};

/// The thread "turn:NAME" of a camera that turns: between capture and those that look and draw, it
/// lets the picture refine the angles of each frame. The newest frame wins.
class AngleWorker {
 public:
  /// Null: the camera stands still.
  static std::unique_ptr<AngleWorker> create(const CalibratedCamera& camera, Registry& registry);
  /// `pass_on` gets the frames, on its thread; must not block.
  void start(HeartbeatBoard& beats, std::function<void(const FramePtr&)> pass_on);
  ~AngleWorker() { stop(); }
  void request_stop() { thread_.request_stop(); }
  void stop();

  /// On the capture thread. True: an older frame had to go.
  bool push(FramePtr frame) { return slot_.put(std::move(frame)); }
  /// What moves before it from now on. Any thread, as the rest.
  void see(std::shared_ptr<const MovingScene> scene) { scene_.publish(std::move(scene)); }
  RefinerStatus status() const;

 private:
  AngleWorker(const CalibratedCamera& camera, Registry& registry,
              std::unique_ptr<AngleRefiner> refiner);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  void report();

  const std::string name_;
  std::unique_ptr<AngleRefiner> refiner_;
  LatestSlot<FramePtr> slot_;
  Snapshot<const MovingScene> scene_;  ///< null inside: nothing is known to move
  std::function<void(const FramePtr&)> pass_on_;
  Counter *used_, *refused_, *none_;
  Gauge &latency_, &latency_sigma_, &contradicted_, &sigma_;
  mutable std::mutex mutex_;  ///< guards status_
  RefinerStatus status_;
  std::vector<PoseTrackPtr> tracks_;
  WatchedThread thread_;
};

}  // namespace sightline
