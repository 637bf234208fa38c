// SPDX-License-Identifier: Apache-2.0
#include "axes/axes_worker.hpp"

#include "sightline/base/log.hpp"
#include "workers/wait_to_reopen.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {
constexpr Duration kTurn = 100ms;
constexpr Duration kStallLimit = 10s;  // names are looked up
constexpr Duration kOrderEvery = 45ms;
}  // namespace

std::shared_ptr<FollowScene> follow_scene(const FollowConfig& config, const Rig& rig,
                                          std::shared_ptr<const TrackBoard> board) {
  auto scene = std::make_shared<FollowScene>();
  scene->board = std::move(board);
  const auto add = [&](const RigObject& object) {
    const Eigen::Vector3f& center = object.mesh->center;
    scene->targets.push_back({object.named.id, center.cast<double>()});
  };
  for (const RigObject& object : rig.objects) {
    if (config.objects.empty()) add(object);
  }
  for (const std::string& name : config.objects) {
    for (const RigObject& object : rig.objects) {
      if (object.named.name == name) add(object);
    }
  }
  return scene;
}

std::shared_ptr<AxesWorker> AxesWorker::start(const CameraConfig& camera, Registry& registry,
                                              HeartbeatBoard& beats) {
  std::shared_ptr<AxesWorker> worker(new AxesWorker(camera, registry));
  worker->thread_ = start_watched_thread(
      beats, "axes:" + camera.name, kStallLimit,
      [raw = worker.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return worker;
}

AxesWorker::AxesWorker(const CameraConfig& camera, Registry& registry)
    : name_(camera.name),
      options_(camera.axes),
      following_(camera.role == CameraRole::kFollow && can_turn(camera.axes.protocol)),
      config_(camera.follow),
      history_(std::make_shared<AxisHistory>(*camera.calibration.axes,
                                             camera.calibration.model.parameters().fx)),
      readings_(registry.counter("sightline_axes_readings_total",
                                 "Readings of the angles of a camera that turns",
                                 {{"camera", name_}})),
      bad_(registry.counter("sightline_axes_bad_total",
                            "Datagrams to it that were no reading: checksum, length, other device",
                            {{"camera", name_}})),
      known_(registry.gauge("sightline_axes_known",
                            "1 while the angles of a camera that turns are believed",
                            {{"camera", name_}})),
      follower_(camera.follow, camera.calibration) {
  if (!following_) return;
  ordered_ =
      &registry.counter("sightline_follow_orders_total",
                        "Orders to turn to the head of a camera that follows", {{"camera", name_}});
  refused_ = &registry.counter("sightline_follow_refused_total",
                               "Those that the head said it does not do", {{"camera", name_}});
}

AxesWorker::~AxesWorker() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void AxesWorker::report() {
  const AxesState state = history_->at(MonotonicClock::now()).state;
  known_.set(state == AxesState::kKnown ? 1 : 0);
  if (state == told_) return;
  told_ = state;
  if (state == AxesState::kKnown) {
    log::info({.camera = name_}, "{}: its angles are known", name_);
  } else {
    log::warning({.camera = name_, .cause = "axes"},
                 "{}: its angles are {}: it is not measured in and not drawn into", name_,
                 to_string(state));
  }
}

// Where the device counts the other way its places and rates are the other way, too.
void AxesWorker::control(AxisSource& source, Time& next) {
  const Time now = MonotonicClock::now();
  if (now < next) return;
  next = now + kOrderEvery;
  const auto scene = scene_.read();
  if (!scene) return;
  scene->board->read(tracks_);
  std::optional<HeadOrder> order;
  FollowMode before{}, after{};
  {
    const std::lock_guard lock(mutex_);
    before = follower_.status().mode;
    order = follower_.step(now, *history_, tracks_, scene->targets,
                           SharedHead{*scene->sharing, scene->head});
    after = follower_.status().mode;
  }
  if (after != before) tell_mode(after);
  if (!order) return;
  const CameraAxes& axes = history_->axes();
  const Eigen::Array2d scale(axes.pan_scale, axes.tilt_scale);
  source.turn({order->place.array() / scale, order->rate.array() / scale});
}

void AxesWorker::tell_mode(FollowMode mode) {
  if (mode == FollowMode::kYielding) {
    log::warning(
        {.camera = name_, .cause = "follow"},
        "{}: somebody else turns it, or it does not turn as it is told: nothing is ordered "
        "for {:.0f} s",
        name_, to_seconds(config_.yield));
  } else {
    log::info({.camera = name_}, "{}: its head is {}", name_, to_string(mode));
  }
}

Status AxesWorker::hold(const std::optional<HeadAngles>& place, Duration time) {
  if (!following_) {
    return make_error(ErrorCode::kInvalidInput, name_,
                      "its head is not turned: give the camera role = \"follow\"");
  }
  const HeadLimits& limits = config_.limits;
  if (place && ((place->array() < limits.low.array()).any() ||
                (place->array() > limits.high.array()).any())) {
    return make_error(ErrorCode::kInvalidInput, name_,
                      "the place lies outside of pan_range_deg and tilt_range_deg");
  }
  const std::lock_guard lock(mutex_);
  follower_.hold(place, MonotonicClock::now() + time);
  return {};
}

Status AxesWorker::release() {
  if (!following_) {
    return make_error(ErrorCode::kInvalidInput, name_,
                      "it follows nothing: give the camera role = \"follow\"");
  }
  const std::lock_guard lock(mutex_);
  follower_.release();
  return {};
}

FollowStatus AxesWorker::status() const {
  const std::lock_guard lock(mutex_);
  return follower_.status();
}

Status AxesWorker::read(AxisSource& source, const std::stop_token& stop, Heartbeat& heartbeat) {
  AxisSource::Counts before;
  Time next{};
  while (!stop.stop_requested()) {
    heartbeat.beat();
    SL_ASSIGN(const auto reading, source.next(following_ ? kTurn / 4 : kTurn));
    if (reading) history_->add(*reading);
    if (following_) control(source, next);
    const AxisSource::Counts now = source.counts();
    readings_.add(now.good - before.good);
    bad_.add(now.bad - before.bad);
    if (following_) {
      ordered_->add(now.ordered - before.ordered);
      refused_->add(now.refused - before.refused);
    }
    before = now;
    report();
  }
  return {};
}

void AxesWorker::run(std::stop_token stop, Heartbeat& heartbeat) {
  Backoff backoff(name_);
  std::string told;
  while (!stop.stop_requested()) {
    auto source = open_axis_source(options_, name_);
    const Status status =
        source ? read(**source, stop, heartbeat) : Status(std::move(source).error());
    if (status) continue;
    const std::string problem = status.error().message();
    if (problem != told) {
      log::warning({.camera = name_, .cause = "axes"}, "{}; it is tried again", problem);
    }
    told = problem;
    report();
    heartbeat.beat();
    sleep_unless_stopped(stop, backoff.next());
  }
}

}  // namespace sightline
