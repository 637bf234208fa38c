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

#include "sightline/base/bounded_queue.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/pipeline/source_factory.hpp"
#include "sightline/record/writer.hpp"

namespace sightline {

/// The images of cameras that need no calibration, written as they come: nothing is looked for in
/// them. A thread for each camera ("cap:NAME"), one that writes ("record"). It begins once each
/// camera has sent an image, as their sizes are not known before; what came earlier is left out.
/// So is an image of another size than its camera's first.
class ImageRecording {
 public:
  /// Refuses a folder that cannot be made, or holds something.
  static Result<std::unique_ptr<ImageRecording>> start(const Installation& installation,
                                                       const std::filesystem::path& folder);
  ~ImageRecording();

  /// All cameras are recordings, and have been played and written.
  bool ended() const;
  /// Why it cannot go on; empty: it can.
  std::string problem() const;
  /// Cameras without an image so far, and why: "camera left: no such device".
  std::string waits_for() const;
  uint64_t written() const;
  /// Frames that the disk had no time for.
  uint64_t dropped() const { return dropped_; }

  /// Finishes the files. An Error if there was one, or nothing was recorded.
  Status stop();

 private:
  struct Camera {
    std::string name;
    SourceFactory::Opener open;
    std::optional<RecordingWriterCamera> first;  // of the first frame
    std::string problem;
    bool ended = false;
  };
  ImageRecording(const Installation& installation, std::filesystem::path folder);
  void capture(size_t index, const std::stop_token& stop);
  void note(size_t index, const std::string& problem);
  /// True: to be written.
  bool take(size_t index, const Frame& frame);
  void push(FramePtr frame);
  void write(const std::stop_token& stop);
  Status write_one(const FramePtr& frame);
  Status open_writer();
  bool complete() const;

  const std::string name_;
  const std::filesystem::path folder_;
  const RawStorage raw_storage_;
  Registry registry_;
  SourceFactory sources_{registry_};
  BoundedQueue<FramePtr> queue_{256};
  std::atomic<size_t> queued_bytes_{0};
  std::atomic<uint64_t> dropped_{0};
  mutable std::mutex mutex_;  // guards the next four
  std::vector<Camera> cameras_;
  Status status_;
  uint64_t written_ = 0;
  bool over_ = false;
  std::unique_ptr<RecordingWriter> writer_;
  std::vector<std::jthread> capturing_;
  std::jthread writing_;
};

}  // namespace sightline
