// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/model/stream_types.hpp"
#include "sightline/pipeline/last_poses.hpp"
#include "sightline/pipeline/track_board.hpp"

namespace sightline {

/// The thread ("last") that keeps where objects are over a restart: the newest pose in state
/// tracking of each, written every few seconds if it has changed, and at the end.
class LastPoseKeeper {
 public:
  /// Poses of other objects of the installation that the file has stay in it.
  static std::shared_ptr<LastPoseKeeper> start(std::filesystem::path file,
                                               std::vector<NamedObject> objects,
                                               std::shared_ptr<TrackBoard> board,
                                               HeartbeatBoard& beats);
  ~LastPoseKeeper() { (void)stop_unless_waiting(kPatience); }

  /// Writes what is known now. False: the disk takes longer than that, and the thread is left.
  bool stop_unless_waiting(Duration patience);

 private:
  static constexpr Duration kPatience = std::chrono::seconds(1);
  LastPoseKeeper(std::filesystem::path file, std::vector<NamedObject> objects,
                 std::shared_ptr<TrackBoard> board);
  void run(const std::stop_token& stop, Heartbeat& heartbeat);
  /// Takes the newest poses; true if one is elsewhere than in the file.
  bool look();
  void write();

  const std::filesystem::path file_;
  const std::vector<NamedObject> objects_;
  const std::shared_ptr<TrackBoard> board_;
  std::map<std::string, PoseLogRow> newest_, written_;  // by name
  std::vector<PoseTrackPtr> tracks_;
  bool failed_ = false;  // and the log has it
  std::mutex mutex_;
  std::condition_variable_any never_;
  WatchedThread thread_;
};

}  // namespace sightline
