// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/bounded_queue.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/record/writer.hpp"

namespace sightline {

struct RecorderOptions {
  /// Each recording makes a folder in it, named by the time. One that cannot be started, or that
  /// stops, is reported, and another is tried for ever, with back-off.
  std::filesystem::path directory;
  /// If set: this folder, once; its first error is final.
  std::filesystem::path folder;
  RecordingWriterOptions writer;
  std::vector<std::string> objects;  ///< names, by ObjectId
  bool wanted = true;                ///< begins at once
};

struct RecordingStatus {
  std::filesystem::path folder;  ///< what is written; empty: nothing
  std::string problem;           ///< why nothing is written; empty: it is, or is about to be
  int64_t since_utc_ns = 0;      ///< of `folder`
};

/// The thread that writes recordings ("record"), behind a bounded queue: capture and fuse never
/// wait for the disk. What does not fit (256 MiB of frames) is dropped and counted. A full disk
/// ends the recording and nothing else.
class RecorderWorker {
 public:
  /// Fails only for a `folder` that cannot be written.
  static Result<std::unique_ptr<RecorderWorker>> start(RecorderOptions options, Registry& registry,
                                                       HeartbeatBoard& beats);
  ~RecorderWorker() { (void)stop(); }

  void push(const FramePtr& frame);         ///< never waits; any thread
  void push(const PoseEstimate& estimate);  ///< never waits; any thread
  void request_stop() {
    leaving_ = true;
    thread_.request_stop();
  }
  /// Writes what is queued, for a second where recordings are made for ever, and finishes the
  /// files. The error by which nothing was written any more, if any.
  Status stop();
  /// Same, but leaves a thread that waits for the disk once `patience` has passed. False then: the
  /// recording opens without its last second, and this object has to outlive that thread, or the
  /// process to end. A recording into `folder` is waited for.
  bool stop_unless_waiting(Duration patience);
  RecordingStatus status() const;

  /// Records from now on, until end() or for so long; any thread, never waits. Only where each
  /// recording makes a folder of its own.
  void begin(std::optional<Duration> for_at_most);
  void end();
  bool wanted() const { return wanted_ || MonotonicClock::now() < until_.load(); }
  /// begin() without a time, or RecorderOptions::wanted, and no end() since.
  bool wanted_for_good() const { return wanted_; }
  uint64_t written() const { return written_here_; }  ///< frames of the newest recording
  uint64_t dropped() const { return dropped_.value(); }
  /// The most entries that waited at once since the last call, and bytes that wait now.
  size_t queue_peak() { return queue_.take_peak(); }
  size_t queued_bytes() const { return queued_bytes_; }

 private:
  struct Entry {
    FramePtr frame;         // null: an estimate
    PoseEstimate estimate;  // else default
  };

  RecorderWorker(RecorderOptions options, Registry& registry);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  void wait_to_open(const std::stop_token& stop, Heartbeat& heartbeat);
  Status open();
  Status check_space() const;
  std::filesystem::path new_folder() const;
  void write_queued(const std::stop_token& stop, Heartbeat& heartbeat);
  void rest(const std::stop_token& stop, Heartbeat& heartbeat);
  /// Takes one entry out of the queue and writes it, or lets go of it; false if there is none.
  bool take(const std::stop_token& stop, Duration timeout, bool keep);
  Status write(const Entry& entry);
  void fail(const Error& error);
  /// Metrics of what is recorded now. On its way out a worker leaves them to the one that follows.
  void show(bool recording, bool stopped);
  void close();
  /// What was recorded, if there is nothing in it.
  void remove_folder() const;
  void push_entry(Entry entry);
  bool retries() const { return options_.folder.empty(); }

  const RecorderOptions options_;
  std::vector<std::string> cameras_;
  std::unique_ptr<RecordingWriter> writer_;  // null: nothing is written now
  std::atomic<bool> writing_{false};
  std::atomic<bool> leaving_{false};
  std::atomic<bool> wanted_;
  std::atomic<Time> until_{Time{}};
  std::atomic<uint64_t> written_here_{0};
  BoundedQueue<Entry> queue_{512};
  std::atomic<size_t> queued_bytes_{0};  // of the frames in it, which keep their buffers meanwhile
  Counter &dropped_, &written_, &failures_;
  Gauge &recording_, &stopped_;
  Duration wait_{};           // before the next attempt
  Time opened_{};             // the newest recording
  std::string said_;          // why it stopped last, as the log has it
  mutable std::mutex mutex_;  // guards the three below
  Status status_;
  std::filesystem::path folder_;
  int64_t since_utc_ns_ = 0;
  WatchedThread thread_;
};

}  // namespace sightline
