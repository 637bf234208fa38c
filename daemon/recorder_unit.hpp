// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/bounded_queue.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/record/writer.hpp"

namespace sightline {

/// The thread that writes a recording ("record"), behind a bounded queue: capture and fuse never
/// wait for the disk. What does not fit (256 MiB of frames) is dropped and counted; a full disk
/// ends the recording and nothing else.
class RecorderUnit {
 public:
  static Result<std::unique_ptr<RecorderUnit>> start(const std::filesystem::path& folder,
                                                     const RecordingWriterOptions& options,
                                                     std::vector<std::string> objects,
                                                     Registry& registry, HeartbeatBoard& beats);
  ~RecorderUnit() { (void)stop(); }

  void push(const FramePtr& frame);         ///< never waits; any thread
  void push(const PoseEstimate& estimate);  ///< never waits; any thread
  /// Writes what is queued and finishes the files; the first error of the recording, if any.
  Status stop();
  /// Why it stopped writing, or empty.
  std::string problem() const;
  const std::filesystem::path& folder() const { return folder_; }

 private:
  using Entry = std::variant<FramePtr, PoseEstimate>;

  RecorderUnit(std::filesystem::path folder, std::unique_ptr<RecordingWriter> writer,
               std::vector<std::string> cameras, std::vector<std::string> objects,
               Registry& registry);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  Status write(const Entry& entry);
  void note(Status status);
  void push_entry(Entry entry);

  const std::filesystem::path folder_;
  std::unique_ptr<RecordingWriter> writer_;
  const std::vector<std::string> cameras_, objects_;
  BoundedQueue<Entry> queue_{512};
  std::atomic<size_t> queued_bytes_{0};  // of the frames in it, which keep their buffers meanwhile
  Counter &dropped_, &written_;
  mutable std::mutex mutex_;
  Status status_;
  std::jthread thread_;
};

}  // namespace sightline
