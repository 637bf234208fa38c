// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "calibration/capture_service.hpp"
#include "order_queue.hpp"
#include "system/overlay_overrides.hpp"
#include "system/system_builder.hpp"
#include "system/wait_report.hpp"

namespace sightline {

class SystemExchange;
struct ConfigReport;

struct DaemonOptions {
  /// Records into this folder, whatever the installation says of recording.
  std::filesystem::path record_to{};
  /// Serves streams and HTTP; `sightline record` does without.
  bool serve = true;
  /// Called when the HTTP interface is asked for a reload, on its thread; must not wait. Empty:
  /// that is refused.
  std::function<void()> request_reload{};
  /// Called when somebody ordered over HTTP what Daemon::do_orders() does, on any thread; must not
  /// wait. Empty: there are no such orders.
  std::function<void()> request_orders{};
};

/// The system that runs, and its replacement by another. start() and reload() may take as long as
/// meshes take to load, on one thread; the rest is quick, from any.
class Daemon {
 public:
  /// Everything that can be wrong is found before the first thread starts. Sources that are absent
  /// are no error, nor is a disk that takes no recording: they are tried again for ever. After
  /// `stop` it gives up where it can.
  static Result<std::unique_ptr<Daemon>> start(Installation installation,
                                               const DaemonOptions& options,
                                               std::stop_token stop = {});
  ~Daemon();

  /// Reads the file and makes the running system agree with it, restarting only what differs. On
  /// an error the old one goes on, and the status says so. Never throws.
  Status reload(const std::filesystem::path& file, std::stop_token stop);
  /// What was ordered over HTTP and takes a moment or a disk; on the thread of reload().
  void do_orders(std::stop_token stop);
  /// Sources first, streams last; a reload that is under way changes nothing any more. The
  /// recording's error, if it had one. What waits for a device or a disk is left, and said in
  /// `left`: destroying the daemon waits for it.
  Status stop(StopLeft* left = nullptr);

  /// See System; from any thread, never waits.
  Status hint(const std::string& object, const SearchHint& hint) {
    return system_.read()->hint(object, hint);
  }
  Status forget(const std::string& object) { return system_.read()->forget(object); }

  /// What makes no progress; the watchdog is fed while this is empty.
  std::vector<std::string> stalled() const;
  /// Tells in log and metrics what has been waiting for a device or a disk, and in metrics how
  /// full queues are and how well objects are known, and the cell which cameras give no frames;
  /// call it about twice a second, from one thread.
  void tell_waits();
  /// All cameras play recordings to their end and have got there.
  bool ended() const;
  bool recording() const;
  /// Why nothing is recorded, or empty.
  std::string record_problem() const;
  /// One line for a person: cameras present, objects' states, and what is wrong.
  std::string status_line() const;
  std::vector<std::string> addresses() const;
  /// Brings the metric of lost log messages up to date; one thread.
  void count_lost_messages();

 private:
  Daemon(const DaemonOptions& options, std::shared_ptr<HttpWaker> waker);
  Status prepare_web();
  void add_orders();
  void add_capture_orders();
  /// The running system with another overlay: `change` of its installation.
  HttpReply restyle(const std::function<Status(Installation&)>& change);
  HttpReply scene_mesh();
  HttpReply start_capture(const CaptureOrder& order);
  HttpReply accept_calibration(const std::vector<std::string>& cameras);
  Status replace(Installation next, std::stop_token stop);
  Status exchange(const System& old, SystemDraft draft);
  void publish(SystemExchange& exchange, const System& old);
  /// After a change that broke off halfway: the old installation, from nothing.
  void restore(const System& old);
  void note_loaded(const std::filesystem::path& file, const std::string& content);
  void note_refused(const Error& error);
  Health health() const;
  /// Those that last long enough to be told.
  std::vector<ThreadWait> waits() const;

  const DaemonOptions options_;
  Registry registry_;
  HeartbeatBoard beats_;
  SourceFactory sources_{registry_};
  const std::shared_ptr<HttpWaker> waker_;
  SystemContext context_;  // complete after prepare_web()
  const std::shared_ptr<CaptureService> captures_;
  OrderQueue orders_;
  OverlayOverrides overlays_;
  std::stop_token orders_stop_;  // the control thread's, as the next two
  std::weak_ptr<const Rig> scene_mesh_of_;
  HttpReply scene_mesh_;

  WaitReport wait_report_{registry_};
  Snapshot<const System> system_;        // never null inside
  Snapshot<const ConfigReport> config_;  // never null inside
  std::mutex change_mutex_;              // held while systems are exchanged or stopped
  bool stopping_ = false;                // guarded by it
  std::atomic<bool> broken_{false};      // nothing whole runs
};

}  // namespace sightline
