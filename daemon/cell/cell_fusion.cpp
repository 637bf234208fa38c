// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_fusion.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"
#include "sightline/publish/cell/frozen_observation.hpp"
#include "web/pose_json.hpp"
#include "workers/stage_latency.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kLastEvery = 1s;
constexpr Duration kDoubtLasts = 1s;  // of a host that says nothing more

std::vector<ObservationGate::Camera> gate_cameras(const CellParts& parts) {
  std::vector<ObservationGate::Camera> cameras;
  auto id = static_cast<uint32_t>(parts.cameras.size());
  for (const RemoteCamera& camera : parts.options.cameras) {
    cameras.push_back({CameraId(id++), camera});
  }
  return cameras;
}

}  // namespace

CellCounters cell_counters(Registry& registry, const char* what) {
  CellCounters counters{};
  for (size_t i = 0; i < kCellVerdicts; ++i) {
    const std::string verdict(to_string(static_cast<CellVerdict>(i)));
    counters[i] = &registry.counter("sightline_cell_messages_total",
                                    "Messages of other hosts, by what became of them",
                                    {{"kind", what}, {"verdict", verdict}});
  }
  return counters;
}

CellFusion::CellFusion(const CellParts& parts, const CellIdentity& self, Registry& registry)
    : parts_(parts),
      self_(self),
      topics_(parts.options.name),
      claim_(self),
      gate_(gate_cameras(parts), parts.names.objects, parts.options.age_limit),
      counters_(cell_counters(registry, "observation")),
      published_(registry.counter("sightline_cell_tracks_sent_total", "Estimates that were sent")),
      refused_(registry.counter("sightline_cell_refused_total",
                                "Observations left out since another host keeps the estimates")),
      doubts_(parts.names.objects.size()),
      sent_(parts.names.objects.size()),
      sent_until_(parts.names.objects.size()) {
  if (!parts.options.neighbors.empty()) {
    neighbors_ = std::make_unique<CellNeighbors>(parts, self, registry);
  }
  for (const std::string& camera : parts.names.cameras) {
    latencies_.push_back(&stage_latency(registry, camera, "fused"));
  }
}

void CellFusion::push(const PoseEstimate& estimate, FusionWorker::Cause cause) {
  // With neighbors the estimates of frames, too, are passed on to others here once it is known
  // whose they are.
  if (cause == FusionWorker::Cause::kFrame && !neighbors_) return;
  estimates_.push(estimate, cause);
}

std::vector<uint64_t> CellFusion::verdicts() const {
  std::vector<uint64_t> counts;
  for (const Counter* counter : counters_) counts.push_back(counter->value());
  return counts;
}

void CellFusion::count(CellVerdict verdict, const std::string& camera) {
  counters_[static_cast<size_t>(verdict)]->add();
  const bool lasting = verdict == CellVerdict::kOtherCalibration || verdict == CellVerdict::kFuture;
  const std::pair key(camera, verdict);
  if (!lasting || std::ranges::find(told_, key) != told_.end()) return;
  told_.push_back(key);
  log::warning({.cause = "cell"}, "cell: camera {}: its observations are refused: {}", camera,
               verdict == CellVerdict::kFuture
                   ? "they come from the future: the clock of its host or of this one is wrong"
                   : "its host has another calibration of it");
}

void CellFusion::on_observation(std::string_view cell, std::string_view topic,
                                std::string_view payload, const ClockWatch& clock, Time now) {
  auto observation = decode_observation(payload);
  if (!observation) return count(CellVerdict::kMalformed, "");
  if (observation->boot == self_.boot && cell.empty()) return;  // for the neighbors
  // Brokers let hosts write topics: what is inside has to be of the same camera and object.
  const auto wanted = [&](const CellTopics& topics) {
    return topics.observation(observation->camera, observation->object);
  };
  if (topic != (cell.empty() ? wanted(topics_) : wanted(CellTopics(std::string(cell))))) {
    return count(CellVerdict::kForeign, observation->camera);
  }
  const ClockState state = clock.state(now);
  const auto pass = gate_.check(*observation, clock.utc_ns_of(now), state.fit,
                                state.bound + parts_.options.clock_limit, cell);
  count(pass.verdict, observation->camera);
  if (pass.verdict != CellVerdict::kTaken) return;
  if (!claim_.holds()) return refused_.add();
  note_doubt(*observation, pass.object, now);
  if (neighbors_ && !observation->at.empty()) neighbors_->note_seen(pass.object, now);
  const Time capture = clock.time_of(observation->capture_utc_ns);
  Observation taken = thaw(*std::move(observation), pass.object, pass.camera, capture);
  taken.capture_error += state.bound;
  parts_.fusion->push(std::move(taken), latencies_[pass.camera.index()]);
}

// Doubts come with every observation, so that a lost one does no harm.
void CellFusion::note_doubt(const CellObservation& observation, ObjectId object, Time now) {
  auto& doubts = doubts_[object.index()];
  if (observation.doubted) {
    doubts[observation.host] = now;
  } else {
    doubts.erase(observation.host);
  }
  parts_.fusion->set_doubted(object, !doubts.empty(), FusionWorker::Doubt::kOtherHosts);
}

void CellFusion::end_doubts() { end_old_doubts(Time::max()); }

void CellFusion::end_old_doubts(Time now) {
  for (size_t i = 0; i < doubts_.size(); ++i) {
    const size_t ended = std::erase_if(
        doubts_[i], [now](const auto& doubt) { return now > doubt.second + kDoubtLasts; });
    if (ended == 0 || !doubts_[i].empty()) continue;
    parts_.fusion->set_doubted(ObjectId(static_cast<uint32_t>(i)), false,
                               FusionWorker::Doubt::kOtherHosts);
  }
}

void CellFusion::step(MqttClient* client, const ClockWatch& clock, Time now) {
  end_old_doubts(now);
  parts_.own_board->read(tracks_);
  if (neighbors_) neighbors_->step(tracks_, claim_.holds(), client, clock, now);
  pass_on(client, clock);
  if (client == nullptr || !claim_.holds()) return;
  for (size_t i = 0; i < tracks_.size(); ++i) {
    if (tracks_[i] == nullptr || tracks_[i]->empty()) continue;
    if (neighbors_) {
      publish_new(i, *client, clock);
    } else if (tracks_[i] != sent_[i]) {
      sent_[i] = tracks_[i];
      publish(tracks_[i]->newest(), *client, clock);
    }
  }
  if (now >= next_last_) {
    next_last_ = now + kLastEvery;
    parts_.board->read(tracks_);
    publish_last(*client, now);
  }
}

// Whatever of the track is this cell's to publish and was not: also what a neighbor would have
// published, had it not died.
void CellFusion::publish_new(size_t object, MqttClient& client, const ClockWatch& clock) {
  const PoseTrack& track = *tracks_[object];
  Time& until = sent_until_[object];
  until = std::max(until, neighbors_->published(track.object()));
  for (const PoseEstimate& estimate : track.history()) {
    const bool again = estimate.time == until && tracks_[object] != sent_[object] &&
                       &estimate == &track.newest();  // a measurement has joined it
    if (estimate.time < until || (estimate.time == until && !again)) continue;
    if (!neighbors_->publishes(track.object(), estimate.time)) continue;
    publish(estimate, client, clock);
    until = estimate.time;
  }
  sent_[object] = tracks_[object];
}

void CellFusion::pass_on(MqttClient* client, const ClockWatch& clock) {
  const bool speaks = client != nullptr && claim_.holds();
  for (const auto& [estimate, cause] : estimates_.take()) {
    if (neighbors_) {
      if (neighbors_->shows_own(estimate.object)) parts_.on_estimate(estimate, cause);
      if (cause == FusionWorker::Cause::kFrame || !neighbors_->holds(estimate.object)) continue;
    }
    if (speaks) publish(estimate, *client, clock);
  }
}

void CellFusion::publish(const PoseEstimate& estimate, MqttClient& client,
                         const ClockWatch& clock) {
  CellTrack track;
  track.object = parts_.names.objects.at(estimate.object.index());
  track.host = self_.host;
  track.boot = self_.boot;
  track.sequence = ++sequence_;
  if (neighbors_) track.term = neighbors_->term(estimate.object);
  track.time_utc_ns = clock.utc_ns_of(estimate.time);
  track.last_measured_utc_ns = clock.utc_ns_of(estimate.last_measured);
  track.estimate = estimate;
  for (size_t i = 0; i < parts_.names.cameras.size(); ++i) {
    if (estimate.cameras & camera_bit(CameraId(static_cast<uint32_t>(i)))) {
      track.cameras.push_back(parts_.names.cameras[i]);
    }
  }
  if (client.publish(topics_.track(track.object), encode(track), false)) published_.add();
}

void CellFusion::publish_last(MqttClient& client, Time) {
  for (const PoseTrackPtr& track : tracks_) {
    if (track == nullptr || track->empty()) continue;
    const PoseEstimate& newest = track->newest();
    (void)client.publish(topics_.last(parts_.names.objects.at(newest.object.index())),
                         pose_event_json(newest, parts_.names), true, 1);
  }
}

}  // namespace sightline
