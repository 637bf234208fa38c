// SPDX-License-Identifier: Apache-2.0
#include "fusion_unit.hpp"

#include <bit>

#include <fmt/format.h>

#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"

namespace sightline {

using namespace std::chrono_literals;

Result<std::unique_ptr<FusionUnit>> FusionUnit::start(const EstimatorOptions& options,
                                                      const std::vector<NamedObject>& objects,
                                                      const std::vector<Lookalikes>& lookalikes,
                                                      std::shared_ptr<TrackBoard> board,
                                                      Registry& registry, HeartbeatBoard& beats,
                                                      OnEstimate on_estimate) {
  std::vector<ObjectEstimator> estimators;
  for (size_t i = 0; i < objects.size(); ++i) {
    SL_ASSIGN(ObjectEstimator estimator,
              ObjectEstimator::create(options, objects[i].id, lookalikes.at(i)));
    estimators.push_back(std::move(estimator));
  }
  std::unique_ptr<FusionUnit> unit(new FusionUnit(std::move(estimators), objects, std::move(board),
                                                  registry, std::move(on_estimate)));
  Heartbeat& heartbeat = beats.add("fuse", 2s);
  unit->thread_ = start_thread(
      "fuse", [raw = unit.get(), &heartbeat](std::stop_token stop) { raw->run(stop, heartbeat); });
  return unit;
}

FusionUnit::FusionUnit(std::vector<ObjectEstimator> estimators,
                       const std::vector<NamedObject>& objects, std::shared_ptr<TrackBoard> board,
                       Registry& registry, OnEstimate on_estimate)
    : estimators_(std::move(estimators)),
      board_(std::move(board)),
      on_estimate_(std::move(on_estimate)),
      dropped_(registry.counter("sightline_observations_dropped_total",
                                "Observations that the estimator had no time for")) {
  for (const NamedObject& object : objects) {
    const Labels labels{{"object", object.name}};
    counters_.push_back(
        {&registry.counter("sightline_measurements_accepted_total",
                           "Camera measurements that entered the estimate", labels),
         &registry.counter("sightline_measurements_gated_total",
                           "Camera measurements that contradicted the rest", labels),
         &registry.counter("sightline_measurements_late_total",
                           "Measurements older than the ring, not used", labels),
         &registry.gauge("sightline_object_state",
                         "0 searching, 1 tracking, 2 degraded, 3 coasting, 4 lost", labels),
         {}});
    for (int bit = 0; 1 << bit <= kContradicted; ++bit) {
      const Labels reason{{"object", object.name},
                          {"reason", to_string(static_cast<Doubts>(1 << bit), "")}};
      counters_.back().doubts.push_back(&registry.gauge(
          "sightline_object_doubt", "1 while this reason keeps the object from tracking", reason));
    }
    doubted_.push_back({object.name, {}, 0, 0});
  }
}

void FusionUnit::push(Observation observation) {
  if (queue_.push(std::move(observation))) dropped_.add();
}

void FusionUnit::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void FusionUnit::run(std::stop_token stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    heartbeat.beat();
    if (auto observation = queue_.pop(stop, 20ms)) take(*observation);
    const Time now = MonotonicClock::now();
    for (ObjectEstimator& estimator : estimators_) {
      const TrackState before = estimator.state();
      estimator.advance(now);
      if (estimator.state() != before) {
        const PoseTrackPtr track = estimator.track();
        board_->publish(track->object(), track);
        counters_[track->object().index()].state->set(static_cast<double>(estimator.state()));
      }
    }
  }
  heartbeat.retire();
}

// Once for each reason that lasts, not for every frame.
void FusionUnit::say_doubts(const PoseEstimate& estimate, Doubted& doubted) {
  const bool degraded = estimate.state == TrackState::kDegraded;
  const Doubts doubts = degraded ? estimate.doubts : Doubts{0};
  if (doubts != doubted.now) {
    doubted.now = doubts;
    doubted.since = estimate.time;
  }
  if (doubts == doubted.said || estimate.time - doubted.since < 1s) return;
  doubted.said = doubts;
  if (!degraded) return;
  const Eigen::Vector3d way = estimate.weak_direction(), axis = estimate.weak_axis();
  std::string text = to_string(doubts, ", ");
  if (doubts & kWeakPosition) {
    text +=
        fmt::format("; position weakest along ({:.2f}, {:.2f}, {:.2f})", way.x(), way.y(), way.z());
  }
  if (doubts & kWeakRotation) {
    text += fmt::format("; rotation weakest about ({:.2f}, {:.2f}, {:.2f})", axis.x(), axis.y(),
                        axis.z());
  }
  log::info("{}: degraded: {}", doubted.object, text);
}

void FusionUnit::take(const Observation& observation) {
  const size_t index = observation.object.index();
  ObjectEstimator& estimator = estimators_.at(index);
  const UpdateReport report = estimator.process({&observation, 1});
  const ObjectCounters& counters = counters_[index];
  counters.accepted->add(static_cast<uint64_t>(std::popcount(report.accepted)));
  counters.gated->add(static_cast<uint64_t>(std::popcount(report.gated)));
  if (report.dropped) {
    counters.late->add();
    return;
  }
  counters.state->set(static_cast<double>(estimator.state()));
  for (size_t bit = 0; bit < counters.doubts.size(); ++bit) {
    counters.doubts[bit]->set(report.estimate.doubts >> bit & 1);
  }
  say_doubts(report.estimate, doubted_[index]);
  board_->publish(observation.object, estimator.track());
  if (on_estimate_) on_estimate_(report.estimate);
}

}  // namespace sightline
