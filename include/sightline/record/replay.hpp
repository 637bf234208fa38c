// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/seams.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/video_reader.hpp"

namespace sightline {

/// By camera; null: it stands still.
using AxisHistories = std::vector<std::shared_ptr<AxisHistory>>;

/// Plays a recording as fast as it is asked, on its own clock: frames wear the capture and arrival
/// times of frames.csv, nothing is dropped, and every run gives the same frames in the same order.
/// CameraId is the index in Recording::cameras; epoch is 0. One thread at a time.
class VirtualReplay {
 public:
  /// `time_offsets`: by camera, added to the capture times (none: 0); the order goes by the sums.
  /// `axes`: by camera, of those that turn: the recorded angles are put into them as time passes,
  /// and each frame says where its camera stood (null, none: the camera stands still).
  static Result<std::unique_ptr<VirtualReplay>> open(std::shared_ptr<const Recording> recording,
                                                     const VideoReaderOptions& options = {},
                                                     std::vector<Duration> time_offsets = {},
                                                     AxisHistories axes = {});
  virtual ~VirtualReplay() = default;

  /// All frames of the next capture time, ordered by camera index; nullopt at the end. Sets come in
  /// order of capture time, so synchronous cameras come together and free-running ones alone.
  virtual Result<std::optional<std::vector<FramePtr>>> next() = 0;
};

/// Maps a recording's time onto CLOCK_MONOTONIC. Shared by the sources of all cameras of one
/// recording, which therefore stay in step, also when looping. Immutable: any thread.
class ReplayClock {
 public:
  /// The recording's first capture happens at `start`.
  ReplayClock(const Recording& recording, Time start);

  /// When a recorded time happens in turn `loop` (0: first).
  Time at(Time recorded, uint64_t loop) const;
  /// Time from one turn to the next: the recording's duration and one frame period.
  Duration loop_period() const { return loop_period_; }

 private:
  Time start_{};
  Time first_capture_{};
  Duration loop_period_{1};
};

struct PacedReplayOptions {
  bool loop = false;
  /// Decoded pictures are kept during the first turn if the camera's whole video fits in so many
  /// bytes; later turns then cost no decoding.
  size_t keep_decoded_bytes = size_t{64} << 20;
  /// A frame that cannot be delivered within this time of its arrival is dropped and counted.
  Duration max_late = std::chrono::milliseconds(250);
  bool payload = false;
  /// Of a camera that turns, as of VirtualReplay::open(), and its time offset, which counts for the
  /// angles only: frames keep their stamps.
  std::shared_ptr<AxisHistory> axes = nullptr;
  Duration time_offset{0};
};

/// One camera of a recording in real time: next() returns a frame when its mapped arrival time has
/// come. Capture times are on CLOCK_MONOTONIC; when looping, sequence and capture go on growing and
/// the epoch stays 0. `camera` is the index in recording->cameras, and `id` the CameraId that its
/// frames wear.
Result<std::unique_ptr<FrameSource>> open_paced_replay(std::shared_ptr<const Recording> recording,
                                                       size_t camera, CameraId id,
                                                       std::shared_ptr<const ReplayClock> clock,
                                                       const PacedReplayOptions& options = {});

}  // namespace sightline
