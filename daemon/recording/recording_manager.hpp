// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "recording/recording_library.hpp"
#include "recording/recording_sink_worker.hpp"
#include "recording/zone_watch.hpp"
#include "sightline/config/record_config.hpp"
#include "workers/frame_taps.hpp"

namespace sightline {

/// Everything that is recorded while the daemon runs: begins and ends recordings of the three
/// kinds, by configuration, by order, when an object is lost, and when one
/// comes into a zone. Lives as long as the process.
class RecordingManager {
 public:
  static std::shared_ptr<RecordingManager> start(Registry& registry, HeartbeatBoard& beats,
                                                 std::shared_ptr<HttpWaker> waker,
                                                 std::shared_ptr<FrameTaps> taps);

  /// The installation in force; begins what it names if it did not before. One thread.
  void configure(const RecordConfig& config, const std::vector<ZoneConfig>& zones);
  /// What ids mean from now on.
  void rename(FeedNames names) {
    names_.publish(std::make_shared<const FeedNames>(std::move(names)));
  }
  /// On the estimator's thread; never waits. `of_frame`: one that poses.csv has a row for.
  void push(const PoseEstimate& estimate, bool of_frame);
  const std::shared_ptr<ZoneWatch>& zones() const { return zones_; }
  /// Where streams hand their packets over.
  const std::shared_ptr<RecordingSinkWorker>& viewing() const { return viewing_; }

  // Orders of an operator; any thread, none waits. An empty list: those of the configuration.
  Status begin(const RecordingOrder& order);
  Status end(const RecordingOrder& order);
  Status mark(const std::string& text);
  std::string json() const;
  /// A file of a recording, or of its bytes those of a Range header.
  Result<HttpReply> file(const std::string& name, const std::string& file,
                         const std::string& range) const;
  /// Why something that was ordered is not being recorded; empty: nothing.
  std::string problem() const;

  const std::shared_ptr<RecordingSinkWorker>& poses() const { return poses_; }

  /// Finishes what is written; names what had to be left.
  std::vector<std::string> stop(Duration patience);

 private:
  RecordingManager() = default;
  Result<std::vector<RecordingKind>> kinds_of(const RecordingOrder& order) const;
  RecordingSinkStatus status(RecordingKind kind) const;
  void begin(RecordingKind kind, std::optional<Duration> for_at_most, const std::string& why);
  void end(RecordingKind kind, const std::string& why);
  void note_lost(const PoseEstimate& estimate);
  void note_zones(const PoseEstimate& estimate);

  std::shared_ptr<FrameTaps> taps_;
  std::shared_ptr<RecordingSinkWorker> viewing_, poses_;
  std::shared_ptr<RecordingLibrary> library_;
  std::shared_ptr<ZoneWatch> zones_;
  Snapshot<const FeedNames> names_;
  Snapshot<const RecordConfig> config_;  // never null inside
  std::set<RecordingKind> by_zones_;     // begin so; configure()'s
  std::vector<TrackState> states_;       // the estimator's thread's, by ObjectId
};

}  // namespace sightline
