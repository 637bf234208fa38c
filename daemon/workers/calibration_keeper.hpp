// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/calibrate/scene_watch.hpp"
#include "sightline/config/installation.hpp"
#include "workers/fusion_worker.hpp"

namespace sightline {

/// The thread ("calib") that tells of what the watch over the cameras' places found: one line of
/// the log for each event, metrics, a proposed calibration in the state folder; and takes the
/// proposal over if the installation says so.
class CalibrationKeeper {
 public:
  struct Options {
    std::filesystem::path proposal;  ///< empty: there is no state folder
    /// Where `rooms`, what each camera has seen of its room, outlives a restart; empty: nowhere.
    std::filesystem::path rooms_file;
    std::shared_ptr<const SceneReferences> rooms;
    std::function<void()> request_reload;  ///< empty: nothing is taken over
  };
  static std::shared_ptr<CalibrationKeeper> start(Options options, Installation installation,
                                                  std::shared_ptr<FusionWorker> fusion,
                                                  Registry& registry, HeartbeatBoard& beats);
  ~CalibrationKeeper() { (void)stop_unless_waiting(kPatience); }

  /// False: the disk takes longer than that, and the thread is left.
  bool stop_unless_waiting(Duration patience);
  /// Where a proposed calibration is, or will be. Any thread.
  const std::filesystem::path& proposal() const { return options_.proposal; }
  /// True while this run has one there: what an earlier one left may be long put right. Any thread.
  bool has_proposed() const { return proposed_; }

 private:
  static constexpr Duration kPatience = std::chrono::seconds(1);
  struct Camera {
    std::string name;
    Gauge *state, *turned, *shifted, *vote;
    Gauge* patches;
    CalibrationState said = CalibrationState::kUnknown;
    std::string unfit{};  ///< what was said of it last
  };

  CalibrationKeeper(Options options, Installation installation,
                    std::shared_ptr<FusionWorker> fusion, Registry& registry);
  void run(const std::stop_token& stop, Heartbeat& heartbeat);
  /// True if an event was told.
  bool tell(const std::vector<CameraWatch>& watches);
  bool tell_unfit(const std::vector<CameraWatch>& watches, size_t index);
  void tell_light(const std::vector<CameraWatch>& watches);
  void propose(const std::vector<CameraWatch>& watches);
  void recover(const std::vector<CameraWatch>& watches);
  void keep_rooms();

  const Options options_;
  const Installation installation_;
  const std::shared_ptr<FusionWorker> fusion_;
  std::vector<Camera> cameras_;  // by CameraId
  std::atomic<bool> proposed_ = false;
  bool failed_ = false, recovered_ = false, rooms_failed_ = false;
  bool light_changed_ = false;
  Time next_proposal_{}, next_rooms_{};
  uint64_t kept_rooms_ = 0;  ///< version that the file has
  std::mutex mutex_;
  std::condition_variable_any never_;
  WatchedThread thread_;
};

}  // namespace sightline
