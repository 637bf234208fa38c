// SPDX-License-Identifier: Apache-2.0
#include "workers/signal_watch.hpp"

#include <algorithm>

#include "sightline/image/convert.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {
constexpr Duration kShortest = 1s;
constexpr Duration kShortestLoss = 800ms;
constexpr int kPeriods = 5;
constexpr int kFirstFrame = 5;  // as many deadlines
}  // namespace

SignalWatch::SignalWatch(int width, int height, Time start)
    : width_(width),
      height_(height),
      lost_after_(kShortestLoss),
      deadline_(kShortest),
      last_time_(start),
      opened_(start) {}

void SignalWatch::set_rate(double rate_hz) {
  std::lock_guard lock(mutex_);
  const Duration periods = rate_hz > 0 ? from_seconds(kPeriods / rate_hz) : Duration(0);
  lost_after_ = std::max<Duration>(kShortestLoss, periods);
  deadline_ = std::max<Duration>(kShortest, periods);
}

void SignalWatch::source_open(Time now) {
  std::lock_guard lock(mutex_);
  open_ = true;
  opened_ = now;
  fresh_ = true;
}

void SignalWatch::good_frame(const FramePtr& frame) {
  FramePtr previous;  // its buffer goes back outside the lock
  std::lock_guard lock(mutex_);
  previous = std::exchange(newest_, frame);
  last_time_ = std::max(frame->info().arrival, last_time_);
  fresh_ = false;
}

void SignalWatch::source_gone() {
  FramePtr newest;
  {
    std::lock_guard lock(mutex_);
    open_ = false;
    newest.swap(newest_);
  }
  if (!newest) return;
  Last last{newest->info(), copy_of(newest)};
  std::lock_guard lock(mutex_);
  kept_ = std::move(last);
}

std::optional<Time> SignalWatch::lost_since(Time now) const {
  std::lock_guard lock(mutex_);
  if (open_ && now - last_time_ <= lost_after_) return std::nullopt;
  return last_time_;
}

bool SignalWatch::stalled(Time now) const {
  std::lock_guard lock(mutex_);
  return fresh_ ? now - opened_ > kFirstFrame * deadline_ : now - last_time_ > deadline_;
}

Duration SignalWatch::deadline() const {
  std::lock_guard lock(mutex_);
  return deadline_;
}

SignalWatch::Last SignalWatch::last() const {
  FramePtr newest;
  {
    std::lock_guard lock(mutex_);
    if (!newest_) return kept_;
    newest = newest_;
  }
  return {newest->info(), copy_of(newest)};
}

std::shared_ptr<const Image> SignalWatch::copy_of(const FramePtr& frame) const {
  if (frame->info().width != width_ || frame->info().height != height_) return nullptr;
  auto image = std::make_shared<Image>(width_, height_);
  copy_i420(frame->i420(), image->mutable_view());
  return image;
}

}  // namespace sightline
