// SPDX-License-Identifier: Apache-2.0
#include "search_unit.hpp"

#include "sightline/base/thread.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 20ms;
constexpr Duration kStallLimit = 10s;  // a search on a busy machine

}  // namespace

std::unique_ptr<SearchUnit> SearchUnit::start(std::unique_ptr<ObjectSearch> search, size_t cameras,
                                              std::shared_ptr<TrackBoard> board,
                                              std::function<void(Observation)> on_observation,
                                              Registry& registry, HeartbeatBoard& beats) {
  std::unique_ptr<SearchUnit> unit(new SearchUnit(std::move(search), cameras, std::move(board),
                                                  std::move(on_observation), registry));
  Heartbeat& heartbeat = beats.add("find", kStallLimit);
  unit->thread_ = start_thread(
      "find", [raw = unit.get(), &heartbeat](std::stop_token stop) { raw->run(stop, heartbeat); });
  return unit;
}

SearchUnit::SearchUnit(std::unique_ptr<ObjectSearch> search, size_t cameras,
                       std::shared_ptr<TrackBoard> board,
                       std::function<void(Observation)> on_observation, Registry& registry)
    : search_(std::move(search)),
      board_(std::move(board)),
      on_observation_(std::move(on_observation)),
      searches_(registry.counter("sightline_searches_total",
                                 "Times an object was looked for in whole pictures")),
      found_(registry.counter("sightline_searches_found_total", "Searches that found an object")),
      seconds_(registry.gauge("sightline_search_seconds", "Duration of the newest search")),
      learns_(cameras),
      newest_(cameras) {}

void SearchUnit::push(const FramePtr& frame) {
  const size_t index = frame->info().camera.index();
  if (frame->info().status == FrameStatus::kDamaged || index >= newest_.size()) return;
  if (!wanted_ && !learns_[index]) return;
  FramePtr replaced = frame;  // released outside the lock
  std::lock_guard lock(mutex_);
  newest_[index].swap(replaced);
}

void SearchUnit::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void SearchUnit::run(std::stop_token stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    heartbeat.beat();
    board_->read(tracks_);
    const bool due = search_->due(MonotonicClock::now(), tracks_);
    wanted_ = due;
    if (!due) learn();
    if (due && take_frames()) search();
    wait(stop, kTurn);
  }
  heartbeat.retire();
}

bool SearchUnit::take_frames() {
  bool any = false;
  for (size_t i = 0; i < newest_.size(); ++i) {
    FramePtr frame;
    {
      std::lock_guard lock(mutex_);
      frame.swap(newest_[i]);
    }
    if (!frame) continue;
    search_->add_frame(CameraId(static_cast<uint32_t>(i)), *frame, tracks_);
    any = true;
  }
  return any;
}

void SearchUnit::learn() {
  const Time now = MonotonicClock::now();
  for (size_t i = 0; i < newest_.size(); ++i) {
    const CameraId camera(static_cast<uint32_t>(i));
    FramePtr frame;
    {
      std::lock_guard lock(mutex_);
      frame.swap(newest_[i]);
    }
    if (frame && search_->learns(camera, frame->info().capture)) {
      search_->learn(camera, *frame, tracks_);
    }
    learns_[i] = search_->learns(camera, now);
  }
}

void SearchUnit::search() {
  const Time start = MonotonicClock::now();
  std::vector<Observation> found = search_->search(start, tracks_);
  searches_.add();
  // Twice: the first step may be a long one, which takes its time too.
  for (int step = 0; step < 2 && !found.empty() && take_frames(); ++step) {
    std::vector<Observation> now = search_->follow();
    if (now.empty()) break;
    found = std::move(now);
  }
  seconds_.set(to_seconds(MonotonicClock::now() - start));
  if (!found.empty()) found_.add();
  for (Observation& observation : found) on_observation_(std::move(observation));
}

void SearchUnit::wait(std::stop_token stop, Duration duration) {
  std::unique_lock lock(mutex_);
  never_.wait_for(lock, stop, duration, [] { return false; });
}

}  // namespace sightline
