// SPDX-License-Identifier: Apache-2.0
#include "workers/search_worker.hpp"

#include "sightline/base/log.hpp"
#include "sightline/base/priority.hpp"
#include "sightline/pipeline/carry_forward.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 20ms;
constexpr Duration kStallLimit = 10s;  // a search on a busy machine

}  // namespace

std::unique_ptr<SearchWorker> SearchWorker::start(std::unique_ptr<ObjectSearch> search,
                                                  size_t cameras, std::shared_ptr<TrackBoard> board,
                                                  std::function<void(Observation)> on_observation,
                                                  std::function<void(ObjectId, bool)> on_doubt,
                                                  Registry& registry, HeartbeatBoard& beats) {
  std::unique_ptr<SearchWorker> worker(new SearchWorker(std::move(search), cameras,
                                                        std::move(board), std::move(on_observation),
                                                        std::move(on_doubt), registry));
  worker->thread_ = start_watched_thread(
      beats, "find", kStallLimit,
      [raw = worker.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return worker;
}

SearchWorker::SearchWorker(std::unique_ptr<ObjectSearch> search, size_t cameras,
                           std::shared_ptr<TrackBoard> board,
                           std::function<void(Observation)> on_observation,
                           std::function<void(ObjectId, bool)> on_doubt, Registry& registry)
    : search_(std::move(search)),
      board_(std::move(board)),
      on_observation_(std::move(on_observation)),
      on_doubt_(std::move(on_doubt)),
      searches_(registry.counter("sightline_searches_total",
                                 "Times an object was looked for in whole images")),
      found_(registry.counter("sightline_searches_found_total", "Searches that found an object")),
      checks_(registry.counter("sightline_pose_checks_total",
                               "Times a pose in force was compared with other orientations")),
      refuted_(registry.counter("sightline_poses_refuted_total",
                                "Poses in force that the images refuted: started anew")),
      seconds_(registry.gauge("sightline_search_seconds", "Duration of the newest search")),
      learns_(cameras),
      trail_(cameras),
      newest_(cameras) {}

void SearchWorker::push(const FramePtr& frame) {
  const size_t index = frame->info().camera.index();
  if (frame->info().status == FrameStatus::kDamaged || index >= newest_.size()) return;
  if (!wanted_ && !learns_[index]) return;
  trail_.push(frame->info().camera, *frame);
  FramePtr replaced = frame;  // released outside the lock
  std::lock_guard lock(mutex_);
  newest_[index].swap(replaced);
}

bool SearchWorker::hint(ObjectId object, const SearchHint& hint, Time until) {
  return search_->hint(object, hint, until);
}

bool SearchWorker::forget(ObjectId object) {
  if (!search_->forget(object)) return false;
  ++forgotten_;
  return true;
}

void SearchWorker::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void SearchWorker::run(std::stop_token stop, Heartbeat& heartbeat) {
  give_way(kSearchNice);
  while (!stop.stop_requested()) {
    heartbeat.beat();
    board_->read(tracks_);
    for (const ObjectId object : search_->note_unseen(tracks_)) on_doubt_(object, true);
    const bool due = search_->due(MonotonicClock::now(), tracks_);
    wanted_ = due;
    if (!due) learn();
    if (due && take_frames() && search_->complete(MonotonicClock::now())) search(stop, heartbeat);
    wait(stop, kTurn);
  }
  for (const ObjectSearch::Doubt& doubt : search_->doubts()) on_doubt_(doubt.object, false);
}

bool SearchWorker::take_frames() {
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

void SearchWorker::learn() {
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

void SearchWorker::search(const std::stop_token& stop, Heartbeat& heartbeat) {
  const Time start = MonotonicClock::now();
  const uint64_t forgotten = forgotten_;
  trail_.open();
  const ObjectSearch::Checks before = search_->checks();
  std::vector<Observation> found = search_->search(start, tracks_);
  tell_doubts();
  const ObjectSearch::Checks now = search_->checks();
  const bool checked = now.done > before.done;
  (checked ? checks_ : searches_).add();
  if (now.refuted > before.refuted) refuted_.add();
  const auto go_on = [&] {
    heartbeat.beat();
    return !stop.stop_requested() && MonotonicClock::now() - start < kMaxCarry;
  };
  const double searched_s = to_seconds(MonotonicClock::now() - start);
  int steps = 0;
  const auto follow = [&](std::span<const FramePtr> frames) {
    ++steps;
    return search_->follow(frames, tracks_);
  };
  found = carry_forward(trail_, std::move(found), follow, go_on);
  trail_.close();
  if (forgotten != forgotten_) found.clear();  // of what was known before
  if (!checked) seconds_.set(to_seconds(MonotonicClock::now() - start));
  if (!found.empty() && !checked) found_.add();
  log::debug("find: {} {:.2f} s, {} steps to now, {}", checked ? "checked" : "searched", searched_s,
             steps,
             found.empty() ? std::string("nothing")
                           : fmt::format("{} observations, {:.2f} s old", found.size(),
                                         to_seconds(MonotonicClock::now() - found.back().capture)));
  const bool any = !found.empty();
  for (Observation& observation : found) on_observation_(std::move(observation));
  if (any) check_found();
}

void SearchWorker::check_found() {
  const uint64_t before = search_->checks().done;
  search_->check_found();
  checks_.add(search_->checks().done - before);
  tell_doubts();
}

void SearchWorker::tell_doubts() {
  for (const ObjectSearch::Doubt& doubt : search_->doubts()) {
    on_doubt_(doubt.object, doubt.doubted);
  }
}

void SearchWorker::wait(std::stop_token stop, Duration duration) {
  std::unique_lock lock(mutex_);
  never_.wait_for(lock, stop, duration, [] { return false; });
}

}  // namespace sightline
