// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <condition_variable>
#include <limits>
#include <mutex>

#include "record/replay_camera.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {

using namespace record;

namespace {

constexpr Duration kDefaultPeriod = std::chrono::milliseconds(33);
constexpr Duration kMarginOfPreroll = std::chrono::milliseconds(20);  // one image takes less
// [bytes] a camera; four seconds of 640x480, one and a half of 1280x720
constexpr size_t kMostPreroll = size_t{64} << 20;

class PacedReplay final : public FrameSource {
 public:
  PacedReplay(std::unique_ptr<ReplayCamera> camera, CameraId id,
              std::shared_ptr<const ReplayClock> clock, const PacedReplayOptions& options)
      : camera_(std::move(camera)), clock_(std::move(clock)), options_(options) {
    const RecordedCamera& from = camera_->camera();
    const double period = to_seconds(from.frame_period());
    info_ = {id, from.name, from.width, from.height, period > 0 ? 1.0 / period : 0.0};
  }

  const SourceInfo& info() const override { return info_; }

  Result<SourceStep> next(std::stop_token stop, Duration timeout) override {
    const Time give_up = MonotonicClock::now() + timeout;
    SL_RETURN_IF_ERROR(wrap());
    SL_ASSIGN(const bool in_time, drop_late(stop, give_up));
    if (!in_time) return SourceStep{SourceStep::Kind::kTimeout, nullptr};
    const auto row = camera_->row();
    if (!row) return SourceStep{SourceStep::Kind::kEnd, nullptr};
    const Time due = clock_->at(row->arrival, loop_);
    preroll(stop, std::min(due, give_up));
    if (!wait_until(stop, std::min(due, give_up)) || due > give_up) {
      return SourceStep{SourceStep::Kind::kTimeout, nullptr};
    }
    RecordedRow stamp = stamp_of(*row);
    SL_ASSIGN(FramePtr frame, camera_->take(stamp));
    dropped_ = 0;
    begun_ = true;
    return SourceStep{SourceStep::Kind::kFrame, std::move(frame)};
  }

 private:
  /// Starts the next turn at the end of this one.
  Status wrap() {
    if (camera_->row() || !options_.loop || camera_->camera().rows.empty()) return {};
    ++loop_;
    return camera_->rewind();
  }

  /// Leaves out whole turns that are over, without decoding them.
  void leave_out_turns(Time now) {
    const auto& row = camera_->row();
    if (!row || !options_.loop) return;
    const Duration late = now - options_.max_late - clock_->at(row->arrival, loop_);
    if (late < clock_->loop_period()) return;
    const auto turns = static_cast<uint64_t>(late / clock_->loop_period());
    loop_ += turns;
    dropped_ += turns * numbers_per_turn();
  }

  /// Passes over frames that are too late, up to the last one of a turn: a slow reader gets fresh
  /// frames and a count, never a growing delay. False: stopped, or the disk takes so long that
  /// `give_up` has come; it goes on at the next call.
  Result<bool> drop_late(const std::stop_token& stop, Time give_up) {
    const Time now = MonotonicClock::now();
    leave_out_turns(now);
    const Time oldest = now - options_.max_late;
    for (bool any = false;; any = true) {
      const auto row = camera_->row();
      if (!row || clock_->at(row->arrival, loop_) >= oldest) return true;
      const bool last = camera_->at_last_row();
      if (last && !options_.loop) return true;
      if (stop.stop_requested() || (any && MonotonicClock::now() > give_up)) return false;
      dropped_ += uint64_t{row->dropped_before} + 1;
      SL_RETURN_IF_ERROR(camera_->skip());
      if (last) SL_RETURN_IF_ERROR(wrap());
    }
  }

  /// The time before the first frame is used: a camera would not decode its pictures on the
  /// machine that has to find the object in them.
  void preroll(const std::stop_token& stop, Time until) {
    if (begun_) return;
    while (!stop.stop_requested() && MonotonicClock::now() < until - kMarginOfPreroll &&
           camera_->decode_ahead(kMostPreroll)) {
    }
  }

  /// Sequence numbers in one turn, lost frames included.
  uint64_t numbers_per_turn() const {
    const auto& rows = camera_->camera().rows;
    return rows.back().sequence - rows.front().sequence + 1;
  }

  RecordedRow stamp_of(const RecordedRow& row) const {
    RecordedRow stamp = row;
    stamp.sequence = row.sequence + loop_ * numbers_per_turn();
    stamp.capture = clock_->at(row.capture, loop_);
    stamp.arrival = std::max(MonotonicClock::now(), clock_->at(row.arrival, loop_));
    const uint64_t dropped = dropped_ + row.dropped_before;
    stamp.dropped_before =
        static_cast<uint32_t>(std::min<uint64_t>(dropped, std::numeric_limits<uint32_t>::max()));
    return stamp;
  }

  /// True once `time` has come, false on stop.
  bool wait_until(std::stop_token stop, Time time) {
    std::unique_lock lock(mutex_);
    for (;;) {
      if (stop.stop_requested()) return false;
      const Duration left = time - MonotonicClock::now();
      if (left <= Duration::zero()) return true;
      wake_.wait_for(lock, stop, left, [] { return false; });
    }
  }

  std::unique_ptr<ReplayCamera> camera_;
  std::shared_ptr<const ReplayClock> clock_;
  const PacedReplayOptions options_;
  SourceInfo info_;
  uint64_t loop_ = 0;
  uint64_t dropped_ = 0;  ///< passed over since the last delivered frame
  bool begun_ = false;    ///< a frame has been delivered
  std::mutex mutex_;      ///< for wake_ only, which nothing but a stop notifies
  std::condition_variable_any wake_;
};

}  // namespace

ReplayClock::ReplayClock(const Recording& recording, Time start)
    : start_(start), first_capture_(recording.first_capture()) {
  for (const auto& camera : recording.cameras) {
    if (camera.rows.empty()) continue;
    const Duration step = std::max(camera.frame_period(), Duration{1});
    const Duration period = camera.rows.size() > 1 ? step : kDefaultPeriod;
    loop_period_ = std::max(loop_period_, camera.rows.back().capture + period - first_capture_);
  }
}

Time ReplayClock::at(Time recorded, uint64_t loop) const {
  return start_ + (recorded - first_capture_) + loop_period_ * static_cast<int64_t>(loop);
}

Result<std::unique_ptr<FrameSource>> open_paced_replay(std::shared_ptr<const Recording> recording,
                                                       size_t camera, CameraId id,
                                                       std::shared_ptr<const ReplayClock> clock,
                                                       const PacedReplayOptions& options) {
  const ReplayCameraOptions camera_options{VideoReaderOptions{options.payload, {}},
                                           options.loop ? options.keep_decoded_bytes : 0,
                                           options.axes, options.time_offset};
  SL_ASSIGN(auto source, ReplayCamera::open(std::move(recording), camera, id, camera_options));
  return std::unique_ptr<FrameSource>(
      std::make_unique<PacedReplay>(std::move(source), id, std::move(clock), options));
}

}  // namespace sightline
