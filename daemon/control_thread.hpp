// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "daemon.hpp"

namespace sightline {

/// The thread ("control") that starts the daemon and reloads it, so that the main thread is there
/// for signals and for the watchdog however long that takes. One thread calls it.
class ControlThread {
 public:
  /// Starts the daemon with the configuration in `file`.
  explicit ControlThread(std::filesystem::path file);

  /// The file is read again after what is under way; several requests may become one reload.
  void request_reload();
  /// Daemon::do_orders() is called after what is under way. From any thread.
  void request_orders();
  /// A start or reload is under way or requested.
  bool busy() const;
  /// Null until it has started.
  std::shared_ptr<Daemon> daemon() const;
  /// Why it did not start.
  std::optional<Error> failure() const;

  /// Stops the daemon, for at most so long: a mesh that is being loaded cannot be interrupted, nor
  /// a disk hurried. False if some thread is left, and then nothing but _exit() may follow.
  bool stop(Duration patience);
  /// What stop() left where it was: it waits for a device or a disk.
  StopLeft left() const;
  /// The daemon has stopped; true also where there never was one.
  bool stopped() const;
  /// What stopping the daemon said.
  Status result() const;

 private:
  void run(const std::stop_token& stop);
  void start(const std::stop_token& stop);
  void stop_daemon();

  const std::filesystem::path file_;
  mutable std::mutex mutex_;  // guards what follows but the threads
  std::condition_variable_any changed_;
  std::shared_ptr<Daemon> daemon_;
  std::optional<Error> failure_;
  Status result_;
  StopLeft left_;
  bool started_ = false, reload_ = false, orders_ = false, working_ = true, ended_ = false,
       stopped_ = false;
  std::jthread thread_, stopper_;
};

}  // namespace sightline
