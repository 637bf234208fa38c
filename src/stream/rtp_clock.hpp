// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

namespace sightline::stream {

/// Maps capture times to the running time of one media pipeline, from which RTP time stamps are
/// made. Where capture times are on the clock of the pipeline (CLOCK_MONOTONIC, a live camera) they
/// are taken as they are, so all streams of a server agree; a source with times of its own (a
/// recording, a loop that starts again) is moved to now once, and again at every jump.
class RtpClock {
 public:
  /// All in ns; `base` is the clock's time at running time 0. The result grows strictly.
  uint64_t running_time(int64_t capture, int64_t now, int64_t base) {
    const int64_t delay = now - (capture + offset_);
    if (!last_ || delay < -kAhead || delay > kBehind) {
      const int64_t plain = now - capture;
      offset_ = plain >= -kAhead && plain <= kBehind ? 0 : plain;
    }
    int64_t time = std::max<int64_t>(capture + offset_ - base, 0);
    if (last_) time = std::max(time, *last_ + 1);
    last_ = time;
    return static_cast<uint64_t>(time);
  }

 private:
  static constexpr int64_t kAhead = 1'000'000'000;
  static constexpr int64_t kBehind = 5'000'000'000;

  int64_t offset_ = 0;
  std::optional<int64_t> last_;
};

}  // namespace sightline::stream
