// SPDX-License-Identifier: Apache-2.0
#include "workers/fusion_worker.hpp"

#include <bit>

#include <fmt/format.h>

#include "sightline/base/check.hpp"
#include "sightline/base/log.hpp"
#include "workers/stage_latency.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {
constexpr Duration kStallLimit = 2s;
constexpr size_t kMostLooks = 1024;  // one a second and camera
}  // namespace

Result<std::unique_ptr<FusionWorker>> FusionWorker::start(
    const EstimatorOptions& options, const std::vector<NamedObject>& objects,
    const std::vector<ShapeSymmetry>& shape_symmetry, const std::vector<AlikeObject>& alike,
    std::shared_ptr<TrackBoard> board, std::unique_ptr<CalibrationWatch> watch, Registry& registry,
    HeartbeatBoard& beats, OnEstimate on_estimate) {
  SL_ASSIGN(auto fusion, ObjectFusion::create(options, objects, shape_symmetry, std::move(board),
                                              std::move(watch)));
  fusion->watch_swaps(alike);
  std::unique_ptr<FusionWorker> worker(
      new FusionWorker(std::move(fusion), objects, registry, std::move(on_estimate)));
  worker->thread_ = start_watched_thread(
      beats, "fuse", kStallLimit,
      [raw = worker.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return worker;
}

FusionWorker::FusionWorker(std::unique_ptr<ObjectFusion> fusion,
                           const std::vector<NamedObject>& objects, Registry& registry,
                           OnEstimate on_estimate)
    : fusion_(std::move(fusion)),
      on_estimate_(std::move(on_estimate)),
      dropped_(registry.counter("sightline_observations_dropped_total",
                                "Observations that the estimator had no time for")),
      doubted_(objects.size()) {
  for (const NamedObject& object : objects) {
    const Labels labels{{"object", object.name}};
    counters_.push_back(
        {&registry.counter("sightline_measurements_accepted_total",
                           "Camera measurements that entered the estimate", labels),
         &registry.counter("sightline_measurements_gated_total",
                           "Camera measurements that contradicted the rest", labels),
         &registry.counter("sightline_measurements_late_total",
                           "Measurements older than the out-of-sequence buffer, not used", labels),
         &registry.gauge("sightline_object_state",
                         "0 searching, 1 tracking, 2 degraded, 3 coasting, 4 lost", labels),
         &registry.gauge("sightline_object_residual_sigmas",
                         "Root mean square of the newest accepted residuals", labels),
         {}});
    for (int bit = 0; 1 << bit <= kFlatPrint; ++bit) {
      const Labels reason{{"object", object.name},
                          {"reason", to_string(static_cast<DegradedReasons>(1 << bit), "")}};
      counters_.back().degraded_reasons.push_back(
          &registry.gauge("sightline_object_degraded_reason",
                          "1 while this reason keeps the object from tracking", reason));
    }
    counters_.back().state->set(static_cast<double>(TrackState::kSearching));
    reason_logs_.push_back({object.name, {}, 0, 0});
  }
}

void FusionWorker::push(Observation observation, LatencyHistogram* latency) {
  if (queue_.push({std::move(observation), latency})) dropped_.add();
}

void FusionWorker::push(SceneLook look) {
  std::lock_guard lock(mutex_);
  if (scene_looks_.size() < kMostLooks) scene_looks_.push_back(std::move(look));
}

void FusionWorker::take_scene_looks() {
  std::vector<SceneLook> looks;
  {
    std::lock_guard lock(mutex_);
    looks.swap(scene_looks_);
  }
  if (fusion_->watch() == nullptr) return;
  bool verdict = false;
  for (const SceneLook& look : looks) verdict |= fusion_->watch()->add(look);
  if (verdict) publish_calibration();
}

void FusionWorker::set_doubted(ObjectId object, bool doubted, Doubt by) {
  const auto bit = static_cast<uint8_t>(by);
  if (doubted) {
    doubted_.at(object.index()) |= bit;
  } else {
    doubted_.at(object.index()) &= static_cast<uint8_t>(~bit);
  }
}

void FusionWorker::forget(ObjectId object) {
  std::lock_guard lock(mutex_);
  forget_.push_back(object);
}

void FusionWorker::set_cameras(std::vector<std::optional<Rigid3>> world_from_camera) {
  std::lock_guard lock(mutex_);
  next_cameras_ = std::move(world_from_camera);
  scene_looks_.clear();
  calibration_.publish(nullptr);  // what it says is of the calibration before
}

void FusionWorker::take_cameras() {
  std::optional<std::vector<std::optional<Rigid3>>> cameras;
  {
    std::lock_guard lock(mutex_);
    cameras.swap(next_cameras_);
  }
  if (!cameras || fusion_->watch() == nullptr) return;
  fusion_->watch()->set_cameras(*cameras);
  publish_calibration();
}

void FusionWorker::publish_calibration() {
  const auto cameras = fusion_->watch()->cameras();
  std::lock_guard lock(mutex_);
  if (next_cameras_) return;
  calibration_.publish(
      std::make_shared<const std::vector<CameraWatch>>(cameras.begin(), cameras.end()));
}

void FusionWorker::forget_those_named() {
  std::vector<ObjectId> objects;
  {
    std::lock_guard lock(mutex_);
    objects.swap(forget_);
  }
  for (const ObjectId object : objects) {
    fusion_->forget(object);
    const ObjectCounters& counters = counters_.at(object.index());
    counters.state->set(static_cast<double>(TrackState::kSearching));
    for (Gauge* reason : counters.degraded_reasons) reason->set(0);
    tell_of_silence(object);
    log::info({.object = reason_logs_[object.index()].object, .cause = "order"}, "{}: forgotten",
              reason_logs_[object.index()].object);
  }
}

void FusionWorker::adopt(PoseTrackPtr track) {
  if (track == nullptr) return;
  std::lock_guard lock(mutex_);
  std::erase_if(adopt_,
                [&](const PoseTrackPtr& older) { return older->object() == track->object(); });
  adopt_.push_back(std::move(track));
}

void FusionWorker::adopt_those_given() {
  std::vector<PoseTrackPtr> tracks;
  {
    std::lock_guard lock(mutex_);
    tracks.swap(adopt_);
  }
  for (const PoseTrackPtr& track : tracks) {
    if (fusion_->adopt(*track)) tell_of_silence(track->object());
  }
}

void FusionWorker::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void FusionWorker::run(std::stop_token stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    heartbeat.beat();
    if (auto item = queue_.pop(stop, 20ms)) take(item->observation, item->latency);
    forget_those_named();
    adopt_those_given();
    take_cameras();
    take_scene_looks();
    for (const ObjectId object : fusion_->advance(MonotonicClock::now())) {
      const TrackState state = fusion_->estimator(object).state();
      counters_[object.index()].state->set(static_cast<double>(state));
      tell_of_silence(object);
      if (state == TrackState::kDegraded) continue;
      for (Gauge* reason : counters_[object.index()].degraded_reasons) reason->set(0);
    }
  }
}

void FusionWorker::tell_of_silence(ObjectId object) {
  if (!on_estimate_) return;
  const PoseTrackPtr& track = fusion_->tracks()[object.index()];
  const TrackState state = fusion_->estimator(object).state();
  PoseEstimate estimate;
  if (track && !track->empty() && track->newest().state == state) {
    estimate = track->newest();
  } else {
    estimate.object = object;
    estimate.time = MonotonicClock::now();
    estimate.state = state;
  }
  on_estimate_(estimate, Cause::kSilence);
}

// Once for each reason that lasts, not for every frame.
void FusionWorker::log_reasons(const PoseEstimate& estimate, ReasonLog& log) {
  const bool degraded = estimate.state == TrackState::kDegraded;
  const DegradedReasons degraded_reasons =
      degraded ? estimate.degraded_reasons : DegradedReasons{0};
  if (degraded_reasons != log.now) {
    log.now = degraded_reasons;
    log.since = estimate.time;
  }
  if (degraded_reasons == log.said || estimate.time - log.since < 1s) return;
  log.said = degraded_reasons;
  if (!degraded) return;
  const Eigen::Vector3d way = estimate.weak_direction(), axis = estimate.weak_axis();
  std::string text = to_string(degraded_reasons, ", ");
  if (degraded_reasons & kWeakPosition) {
    text +=
        fmt::format("; position weakest along ({:.2f}, {:.2f}, {:.2f})", way.x(), way.y(), way.z());
  }
  if (degraded_reasons & kWeakRotation) {
    text += fmt::format("; rotation weakest about ({:.2f}, {:.2f}, {:.2f})", axis.x(), axis.y(),
                        axis.z());
  }
  log::info({.object = log.object, .cause = "degraded"}, "{}: degraded: {}", log.object, text);
}

void FusionWorker::take(const Observation& observation, LatencyHistogram* latency) {
  const size_t index = observation.object.index();
  SL_CHECK(index < counters_.size(), "observation of an object of another installation");
  fusion_->set_doubted(observation.object, doubted_[index] != 0);
  const UpdateReport& report = fusion_->process({&observation, 1}).front();
  if (fusion_->has_verdict()) publish_calibration();
  const ObjectCounters& counters = counters_[index];
  counters.accepted->add(static_cast<uint64_t>(std::popcount(report.accepted)));
  counters.gated->add(static_cast<uint64_t>(std::popcount(report.gated)));
  if (report.dropped) {
    counters.late->add();
    return;
  }
  if (latency != nullptr) observe_age(*latency, observation.capture);
  counters.state->set(static_cast<double>(report.estimate.state));
  if (report.accepted != 0) counters.residual->set(report.residual);
  for (size_t bit = 0; bit < counters.degraded_reasons.size(); ++bit) {
    counters.degraded_reasons[bit]->set(report.estimate.degraded_reasons >> bit & 1);
  }
  log_reasons(report.estimate, reason_logs_[index]);
  if (on_estimate_) on_estimate_(report.estimate, Cause::kFrame);
}

}  // namespace sightline
