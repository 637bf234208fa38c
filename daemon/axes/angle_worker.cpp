// SPDX-License-Identifier: Apache-2.0
#include "axes/angle_worker.hpp"

#include "sightline/base/log.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 200ms;
constexpr Duration kStallLimit = 5s;

Counter& frames_by(Registry& registry, const std::string& camera, const char* word) {
  return registry.counter("sightline_axes_picture_frames_total",
                          "Frames of a camera that turns, by what its picture said of its angles",
                          {{"camera", camera}, {"picture", word}});
}

Gauge& gauge_of(Registry& registry, const std::string& camera, const char* name, const char* help) {
  return registry.gauge(name, help, {{"camera", camera}});
}

}  // namespace

std::unique_ptr<AngleWorker> AngleWorker::create(const CalibratedCamera& camera,
                                                 Registry& registry) {
  auto refiner = AngleRefiner::create(camera);
  if (!refiner) return nullptr;
  return std::unique_ptr<AngleWorker>(new AngleWorker(camera, registry, std::move(refiner)));
}

AngleWorker::AngleWorker(const CalibratedCamera& camera, Registry& registry,
                         std::unique_ptr<AngleRefiner> refiner)
    : name_(camera.name),
      refiner_(std::move(refiner)),
      used_(&frames_by(registry, name_, "used")),
      refused_(&frames_by(registry, name_, "refused")),
      none_(&frames_by(registry, name_, "none")),
      latency_(gauge_of(registry, name_, "sightline_axes_latency_seconds",
                        "Latency of a camera's angles by its picture; 0: not known")),
      latency_sigma_(gauge_of(registry, name_, "sightline_axes_latency_sigma_seconds",
                              "One sigma of that, also while it is not known")),
      contradicted_(gauge_of(registry, name_, "sightline_axes_latency_contradicted",
                             "1 while the picture contradicts latency_s of the calibration")),
      sigma_(gauge_of(registry, name_, "sightline_axes_sigma_radians",
                      "One sigma of the angles in use, the larger of pan and tilt; 0: as read")),
      status_(refiner_->status()) {}

void AngleWorker::start(HeartbeatBoard& beats, std::function<void(const FramePtr&)> pass_on) {
  pass_on_ = std::move(pass_on);
  thread_ = WatchedThread(
      beats, "turn:" + name_, kStallLimit,
      [this](std::stop_token stop, Heartbeat& heartbeat) { run(std::move(stop), heartbeat); });
}

void AngleWorker::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

RefinerStatus AngleWorker::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void AngleWorker::run(std::stop_token stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const auto frame = slot_.take(stop, kTurn);
    if (!frame) continue;
    tracks_.clear();
    const auto scene = scene_.read();
    if (scene) scene->board->read(tracks_);
    pass_on_(refiner_->step(*frame, tracks_,
                            scene ? std::span(scene->boxes) : std::span<const MovingBox>()));
    report();
  }
}

void AngleWorker::report() {
  const RefinerStatus& now = refiner_->status();
  const bool says_nothing =
      now.verdict == RefinerVerdict::kNone || now.verdict == RefinerVerdict::kLearning;
  Counter& frames = now.verdict == RefinerVerdict::kUsed ? *used_
                    : says_nothing                       ? *none_
                                                         : *refused_;
  frames.add();
  latency_.set(now.latency_known ? now.latency_s : 0);
  latency_sigma_.set(now.latency_sigma_s);
  contradicted_.set(now.latency_contradicted ? 1 : 0);
  sigma_.set(now.sigma);
  if (const auto news = refiner_->news()) {
    log::warning({.camera = name_, .cause = "axes"}, "{}", *news);
  }
  const std::lock_guard lock(mutex_);
  status_ = now;
}

}  // namespace sightline
