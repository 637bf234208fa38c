// SPDX-License-Identifier: Apache-2.0
#include "view_unit.hpp"

#include <algorithm>

#include "sightline/base/thread.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

// Drawn so long after the fact, the pose comes from measurements and not from prediction.
constexpr Duration kDelay = 60ms;
constexpr Duration kTurn = 100ms;
constexpr Duration kLately = 300ms;  // a camera that took part so lately is shown as measuring

}  // namespace

std::unique_ptr<ViewUnit> ViewUnit::start(ViewParts parts, Registry& registry,
                                          HeartbeatBoard& beats) {
  std::unique_ptr<ViewUnit> unit(new ViewUnit(std::move(parts), registry));
  const std::string name = "view:" + unit->parts_.name;
  Heartbeat& heartbeat = beats.add(name, 2s);
  unit->thread_ = start_thread(
      name, [raw = unit.get(), &heartbeat](std::stop_token stop) { raw->run(stop, heartbeat); });
  return unit;
}

ViewUnit::ViewUnit(ViewParts parts, Registry& registry)
    : parts_(std::move(parts)),
      pictures_(parts_.view->width(), parts_.view->height()),
      draw_seconds_(registry.gauge("sightline_draw_seconds",
                                   "Copying and drawing the newest shown frame",
                                   {{"camera", parts_.name}})) {}

void ViewUnit::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void ViewUnit::run(std::stop_token stop, Heartbeat& heartbeat) {
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
  heartbeat.retire();
}

void ViewUnit::draw(Time now) {
  const Time shown = now - kDelay;
  std::shared_ptr<Picture> picture = pictures_.get();
  parts_.board->read(tracks_);
  const std::vector<ViewedState> states = viewed_states(tracks_, shown, kLately, parts_.present());
  const ScenePointsPtr points = parts_.points ? parts_.points(shown) : nullptr;
  parts_.view->draw(picture->mutable_view(), shown, tracks_, states, points.get(),
                    annotated_.poses);
  FrameInfo& frame = annotated_.frame;
  frame.camera = parts_.id;
  ++frame.sequence;
  frame.capture = shown;
  frame.arrival = now;
  frame.width = picture->width();
  frame.height = picture->height();
  annotated_.picture = std::move(picture);
  draw_seconds_.set(to_seconds(MonotonicClock::now() - now));
  parts_.output->accept(annotated_);
  annotated_.picture.reset();
}

}  // namespace sightline
