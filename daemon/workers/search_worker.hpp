// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/pipeline/frame_trail.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/track_board.hpp"

namespace sightline {

/// The thread ("find") that looks for objects whose place nobody knows, in the newest frame of each
/// camera. While every object is known it takes a frame of each camera now and then, to know the
/// background, and holds none. Its results are late by the time that a search takes; the poses are
/// carried through the frames that came meanwhile before they go out.
class SearchWorker {
 public:
  /// `on_observation` and `on_doubt` (whether an object's pose is doubted, ObjectSearch::doubts())
  /// are called on the worker's thread and must not block.
  static std::unique_ptr<SearchWorker> start(std::unique_ptr<ObjectSearch> search, size_t cameras,
                                             std::shared_ptr<TrackBoard> board,
                                             std::function<void(Observation)> on_observation,
                                             std::function<void(ObjectId, bool)> on_doubt,
                                             Registry& registry, HeartbeatBoard& beats);
  ~SearchWorker() { stop(); }

  /// Takes a frame, which wears the CameraId of the installation; from any thread, never waits. An
  /// older one of the same camera is dropped.
  void push(const FramePtr& frame);
  /// ObjectSearch::hint() and forget(), of the searches that begin from now on; what is under way
  /// is dropped by the latter. False: the object is not searched for. From any thread, never waits.
  bool hint(ObjectId object, const SearchHint& hint, Time until);
  bool forget(ObjectId object);
  void stop();

 private:
  SearchWorker(std::unique_ptr<ObjectSearch> search, size_t cameras,
               std::shared_ptr<TrackBoard> board, std::function<void(Observation)> on_observation,
               std::function<void(ObjectId, bool)> on_doubt, Registry& registry);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  /// Hands the newest frames to the search; false if there is none.
  bool take_frames();
  /// Learns the background from the newest frames, where that is due, and lets go of them.
  void learn();
  void search(const std::stop_token& stop, Heartbeat& heartbeat);
  void check_found();
  void tell_doubts();
  void wait(std::stop_token stop, Duration duration);

  std::unique_ptr<ObjectSearch> search_;
  std::shared_ptr<TrackBoard> board_;
  std::function<void(Observation)> on_observation_;
  std::function<void(ObjectId, bool)> on_doubt_;
  Counter &searches_, &found_, &checks_, &refuted_;
  Gauge& seconds_;
  std::atomic<bool> wanted_{true};
  std::vector<std::atomic<bool>> learns_;  // by CameraId: a frame is wanted for the background
  FrameTrail trail_;                       // of the search under way
  std::atomic<uint64_t> forgotten_{0};     // calls of forget()
  std::mutex mutex_;                       // guards newest_
  std::condition_variable_any never_;
  std::vector<FramePtr> newest_;  // by CameraId
  std::vector<PoseTrackPtr> tracks_;
  std::jthread thread_;
};

}  // namespace sightline
