// SPDX-License-Identifier: Apache-2.0
#include "workers/virtual_camera_worker.hpp"

#include <algorithm>

namespace sightline {

using namespace std::chrono_literals;

namespace {

// Drawn so long after the fact, the pose comes from measurements and not from prediction.
constexpr Duration kDelay = 60ms;
constexpr Duration kTurn = 100ms;
constexpr Duration kStallLimit = 2s;
constexpr Duration kLately = 300ms;  // a camera that took part so lately is shown as measuring

}  // namespace

std::unique_ptr<VirtualCameraWorker> VirtualCameraWorker::start(VirtualCameraParts parts,
                                                                Registry& registry,
                                                                HeartbeatBoard& beats) {
  std::unique_ptr<VirtualCameraWorker> worker(new VirtualCameraWorker(std::move(parts), registry));
  worker->thread_ = start_watched_thread(
      beats, "view:" + worker->name(), kStallLimit,
      [raw = worker.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return worker;
}

VirtualCameraWorker::VirtualCameraWorker(VirtualCameraParts parts, Registry& registry)
    : parts_(std::move(parts)),
      images_(parts_.view->width(), parts_.view->height()),
      draw_seconds_(registry.gauge("sightline_draw_seconds",
                                   "Copying and drawing the newest shown frame",
                                   {{"camera", parts_.name}})) {}

void VirtualCameraWorker::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void VirtualCameraWorker::run(std::stop_token stop, Heartbeat& heartbeat) {
  const Duration period = from_seconds(1 / parts_.rate_hz);
  Time next = MonotonicClock::now();
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const Time now = MonotonicClock::now();
    if (now < next) {
      std::this_thread::sleep_for(std::min<Duration>(next - now, kTurn));
      continue;
    }
    next = std::max(next + period, now);  // what is late is left out
    if (parts_.output->wanted()) draw(now);
    parts_.output->report();
  }
}

void VirtualCameraWorker::draw(Time now) {
  const Time shown = now - kDelay;
  std::shared_ptr<Image> image = images_.get();
  parts_.board->read(tracks_);
  const std::vector<ViewedState> states = viewed_states(tracks_, shown, kLately, parts_.present());
  const ScenePointsPtr points = parts_.points ? parts_.points(shown) : nullptr;
  parts_.view->draw(image->mutable_view(), shown, tracks_, states, points.get(), annotated_.poses);
  FrameInfo& frame = annotated_.frame;
  frame.camera = parts_.id;
  ++frame.sequence;
  frame.capture = shown;
  frame.arrival = now;
  frame.width = image->width();
  frame.height = image->height();
  annotated_.image = std::move(image);
  draw_seconds_.set(to_seconds(MonotonicClock::now() - now));
  parts_.output->accept(annotated_);
  annotated_.image.reset();
}

}  // namespace sightline
