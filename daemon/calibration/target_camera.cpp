// SPDX-License-Identifier: Apache-2.0
#include "calibration/target_camera.hpp"

#include <utility>

#include "sightline/base/log.hpp"
#include "sightline/base/priority.hpp"
#include "sightline/base/thread.hpp"
#include "workers/backoff.hpp"
#include "workers/wait_to_reopen.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 200ms;
constexpr Duration kExplainAfter = 8s;  // of images without a target, and again after as long

}  // namespace

std::unique_ptr<TargetCamera> TargetCamera::start(Parts parts) {
  std::unique_ptr<TargetCamera> camera(new TargetCamera(std::move(parts)));
  TargetCamera* raw = camera.get();
  const std::string& name = raw->parts_.name;
  const auto fail = [raw](const std::string& what) { raw->fail(what); };
  raw->find_thread_ = start_thread(
      "find:" + name, [raw](const std::stop_token& stop) { raw->find(stop); }, fail);
  if (!raw->parts_.open_source) return camera;
  raw->capture_thread_ = start_thread(
      "cap:" + name, [raw](const std::stop_token& stop) { raw->capture(stop); }, fail);
  return camera;
}

void TargetCamera::request_stop() {
  capture_thread_.request_stop();
  find_thread_.request_stop();
}

void TargetCamera::stop() {
  request_stop();
  for (std::jthread* thread : {&capture_thread_, &find_thread_}) {
    if (thread->joinable()) thread->join();
  }
}

TargetCameraStatus TargetCamera::status() const {
  std::lock_guard lock(mutex_);
  return status_;
}

CharucoLayout TargetCamera::layout() const {
  std::lock_guard lock(mutex_);
  return layout_;
}

void TargetCamera::note_problem(const std::string& problem) {
  std::lock_guard lock(mutex_);
  status_.problem = problem;
}

void TargetCamera::fail(const std::string& what) {
  std::lock_guard lock(mutex_);
  status_.problem = what;
  status_.ended = true;
}

void TargetCamera::capture(const std::stop_token& stop) {
  std::unique_ptr<FrameSource> source;
  Backoff backoff(parts_.name);
  const auto lose = [&](const Error& error) {
    source.reset();
    note_problem(error.where == parts_.name ? error.text : error.message());
    sleep_unless_stopped(stop, backoff.next());
  };
  while (!stop.stop_requested()) {
    if (!source) {
      auto opened = parts_.open_source(stop);
      if (!opened) {
        lose(opened.error());
        continue;
      }
      source = *std::move(opened);
      std::lock_guard lock(mutex_);
      status_.open = true;
      status_.problem.clear();
    }
    auto step = source->next(stop, kTurn);
    if (!step) {
      lose(step.error());
      std::lock_guard lock(mutex_);
      status_.open = false;
      continue;
    }
    if (step->kind == SourceStep::Kind::kEnd) {
      std::lock_guard lock(mutex_);
      status_.ended = true;
      return;
    }
    if (step->kind != SourceStep::Kind::kFrame) continue;
    backoff.reset();
    {
      std::lock_guard lock(mutex_);
      if (status_.frames++ == 0) status_.problem.clear();
    }
    if (step->frame->info().status == FrameStatus::kGood)
      parts_.frames->put(std::move(step->frame));
  }
}

void TargetCamera::explain(const Frame& frame) {
  const std::string reason = explain_missing_target(parts_.target, frame);
  if (!reason.empty()) note_problem("the board is not found: " + reason);
}

void TargetCamera::find(const std::stop_token& stop) {
  if (parts_.nice > 0) give_way(parts_.nice);
  Time unexplained = MonotonicClock::now();
  bool ever = false;
  while (!stop.stop_requested()) {
    const auto frame = parts_.frames->take(stop, kTurn);
    if (!frame) continue;
    const std::vector<DetectedCorner> corners = parts_.detector->detect(**frame);
    {
      std::lock_guard lock(mutex_);
      ++status_.looked_at;
      if (!parts_.open_source) status_.frames = status_.looked_at;
      status_.seen += !corners.empty();
      layout_ = parts_.detector->layout();
      if (!corners.empty()) status_.problem.clear();
    }
    parts_.on_image(**frame, corners);
    ever = ever || !corners.empty();
    if (!ever && MonotonicClock::now() - unexplained > kExplainAfter) {
      explain(**frame);
      unexplained = MonotonicClock::now();
    }
  }
}

}  // namespace sightline
