// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "action_unit.hpp"
#include "camera_unit.hpp"
#include "fusion_unit.hpp"
#include "heartbeat.hpp"
#include "points_unit.hpp"
#include "recorder_unit.hpp"
#include "rig.hpp"
#include "search_unit.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/control/http_server.hpp"
#include "sightline/stream/rtsp_server.hpp"
#include "source_factory.hpp"
#include "stream_output.hpp"
#include "unit_slot.hpp"
#include "view_unit.hpp"

namespace sightline {

struct DaemonOptions {
  /// Records into this folder, whatever the installation says of recording.
  std::filesystem::path record_to;
  /// Serves streams and HTTP; `sightline record` does without.
  bool serve = true;
};

/// The running system: all units, wired. start(), reload() and stop() from the main thread; the
/// rest from any.
class Daemon {
 public:
  /// Everything that can be wrong is found before the first thread starts. Sources that are absent
  /// are no error: they are opened again for ever.
  static Result<std::unique_ptr<Daemon>> start(Installation installation,
                                               const DaemonOptions& options);
  ~Daemon();

  /// Makes the running system agree with `next`, restarting only what differs. On an error nothing
  /// has changed.
  Status reload(Installation next);
  /// Sources first, streams last; within two seconds. The recording's error, if it had one.
  Status stop();

  /// Threads that make no progress; the watchdog is fed while this is empty.
  std::vector<std::string> stalled() const { return beats_.stalled(MonotonicClock::now()); }
  /// All cameras play recordings to their end and have got there.
  bool ended() const;
  /// Why the recording stopped, or empty.
  std::string record_problem() const;
  /// One line for a person: cameras present, objects' states.
  std::string status_line() const;
  std::vector<std::string> addresses() const;

 private:
  Daemon(Installation installation, DaemonOptions options);

  struct Servers {
    std::unique_ptr<RtspServer> rtsp;
    std::unique_ptr<HttpServer> http;
  };
  Status start_servers(const Installation& installation);
  Result<std::unique_ptr<HttpServer>> make_http(const Installation& installation);
  void serve_rtsp(std::unique_ptr<RtspServer> server);
  void stop_rtsp();
  /// Servers of `next` whose address is not taken by those that run.
  Result<Servers> make_moved_servers(const Installation& next);
  void replace_servers(const Installation& next, Servers servers);
  Status start_recorder(const Installation& installation);
  Result<CameraParts> prepare(const Installation& installation, const Rig& rig, size_t camera);
  Result<std::vector<CameraParts>> prepare_all(const Installation& installation, const Rig& rig);
  Status start_pipeline(const Installation& installation, const Rig& rig,
                        std::vector<CameraParts> parts, std::unique_ptr<ObjectSearch> search);
  Status start_camera(const Installation& installation, const Rig& rig, CameraParts parts);
  void start_search(const Installation& installation, std::unique_ptr<ObjectSearch> search);
  void start_points(const Installation& installation, const Rig& rig);
  void stop_cameras();
  Result<std::vector<ViewParts>> prepare_views(const Installation& installation,
                                               const Rig& rig) const;
  Status start_views(const Installation& installation, const Rig& rig,
                     std::vector<ViewParts> views);
  void stop_views();
  /// Which of the named cameras have a signal now.
  std::vector<bool> present(const std::vector<std::string>& names) const;
  Status restart_all(Installation next);
  Status restart_some(Installation next, const InstallationChanges& changes);
  Health health() const;
  std::string state_json() const;

  const DaemonOptions options_;
  Registry registry_;
  HeartbeatBoard beats_;
  SourceFactory sources_{registry_};

  mutable std::mutex mutex_;  // guards what follows against readers during a reload
  Installation installation_;
  std::shared_ptr<const Rig> rig_;
  std::shared_ptr<TrackBoard> board_;
  std::shared_ptr<FusionUnit> fusion_;
  // Nothing to search for: empty.
  std::shared_ptr<UnitSlot<SearchUnit>> search_ = std::make_shared<UnitSlot<SearchUnit>>();
  // Off, or fewer than two cameras observe: empty.
  std::shared_ptr<UnitSlot<PointsUnit>> points_ = std::make_shared<UnitSlot<PointsUnit>>();
  std::shared_ptr<RecorderUnit> recorder_;
  std::unique_ptr<RtspServer> rtsp_;
  std::jthread rtsp_thread_;
  std::map<std::string, std::unique_ptr<CameraUnit>> cameras_;  // by name
  std::vector<std::unique_ptr<ViewUnit>> views_;
  std::unique_ptr<HttpServer> http_;
  std::unique_ptr<ActionUnit> actions_;  // null: none are sent
};

}  // namespace sightline
