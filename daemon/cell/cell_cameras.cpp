// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_cameras.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"
#include "sightline/publish/cell/frozen_observation.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTrackAge = 1s;  // an older estimate is of no use to anybody

Counter& unsent(Registry& registry, const char* reason) {
  return registry.counter("sightline_cell_unsent_total", "Observations that were not sent",
                          {{"reason", reason}});
}

}  // namespace

CellCameras::CellCameras(const CellParts& parts, const CellIdentity& self, Registry& registry)
    : parts_(parts),
      self_(self),
      topics_(parts.options.name),
      doubted_(parts.names.objects.size()),
      sequences_(parts.names.objects.size()),
      counters_(cell_counters(registry, "track")),
      sent_(registry.counter("sightline_cell_observations_sent_total",
                             "Observations that were sent")),
      late_(unsent(registry, "late")),
      no_clock_(unsent(registry, "clock")),
      no_broker_(unsent(registry, "broker")),
      overflow_(unsent(registry, "overflow")),
      no_pose_(unsent(registry, "no_pose")) {
  for (size_t i = 0; i < parts.names.objects.size(); ++i) {
    followers_.emplace_back(ObjectId(static_cast<uint32_t>(i)), parts.noise);
  }
}

void CellCameras::push(const Observation& observation) {
  const size_t object = observation.object.index();
  const size_t camera = observation.camera.index();
  if (object >= parts_.names.objects.size() || camera >= parts_.cameras.size()) return;
  std::vector<PoseTrackPtr> tracks;
  parts_.board->read(tracks);
  auto frozen = freeze(observation, tracks.at(object).get());
  if (!frozen) return no_pose_.add();
  Item item{*std::move(frozen), observation.capture};
  item.observation.object = parts_.names.objects[object];
  item.observation.camera = parts_.cameras[camera].name;
  item.observation.calibration = parts_.cameras[camera].calibration;
  item.observation.host = self_.host;
  item.observation.boot = self_.boot;
  item.observation.doubted = doubted_[object];
  if (queue_.push(std::move(item))) overflow_.add();
}

void CellCameras::send(MqttClient* client, const ClockWatch& clock, Time now) {
  const ClockState state = clock.state(now);
  while (auto item = queue_.pop({}, 0ns)) {
    CellObservation& observation = item->observation;
    if (client == nullptr) {
      no_broker_.add();
    } else if (!state.fit) {
      no_clock_.add();
    } else if (now - item->capture > parts_.options.age_limit) {
      late_.add();
    } else {
      observation.sequence = ++sequence_;
      observation.capture_utc_ns = clock.utc_ns_of(item->capture);
      observation.capture_error += state.bound;
      const std::string topic = topics_.observation(observation.camera, observation.object);
      (client->publish(topic, encode(observation), false) ? sent_ : no_broker_).add();
    }
  }
}

void CellCameras::on_claim(const CellHostState& claim, Time now) {
  if (!claim.online) {
    if (!leader_ || leader_->boot != claim.boot) return;
    log::warning({.cause = "cell"}, "cell: host {} keeps the estimates no more", leader_->host);
    leader_.reset();
    return;
  }
  const bool same = leader_ && leader_->boot == claim.boot;
  if (!same || leader_->beat != claim.beat) leader_heard_ = now;
  if (same) {
    leader_->beat = claim.beat;
    return;
  }
  log::info({.cause = "cell"}, "cell: host {} keeps the estimates", claim.host);
  leader_ = claim;
  std::ranges::fill(sequences_, 0);
}

CellVerdict CellCameras::judge(std::string_view topic, const CellTrack& track,
                               const ClockWatch& clock, Time now, size_t& object) const {
  if (topic != topics_.track(track.object)) return CellVerdict::kForeign;
  const auto& objects = parts_.names.objects;
  object = static_cast<size_t>(std::ranges::find(objects, track.object) - objects.begin());
  if (object == objects.size()) return CellVerdict::kForeign;
  if (!leader_ || track.boot != leader_->boot) return CellVerdict::kForeign;
  if (!clock.state(now).fit) return CellVerdict::kClock;
  const Duration age(clock.utc_ns_of(now) - track.time_utc_ns);
  if (age > kTrackAge) return CellVerdict::kLate;
  if (-age > parts_.options.clock_limit + parts_.options.age_limit) return CellVerdict::kFuture;
  return track.sequence > sequences_[object] ? CellVerdict::kTaken : CellVerdict::kDuplicate;
}

void CellCameras::on_track(std::string_view topic, std::string_view payload,
                           const ClockWatch& clock, Time now) {
  const auto track = decode_track(payload);
  CellVerdict verdict = CellVerdict::kMalformed;
  size_t object = 0;
  if (track) verdict = judge(topic, *track, clock, now, object);
  counters_[static_cast<size_t>(verdict)]->add();
  if (verdict != CellVerdict::kTaken) return;
  sequences_[object] = track->sequence;
  PoseEstimate estimate = track->estimate;
  estimate.object = ObjectId(static_cast<uint32_t>(object));
  estimate.time = clock.time_of(track->time_utc_ns);
  estimate.last_measured = clock.time_of(track->last_measured_utc_ns);
  for (size_t i = 0; i < parts_.names.cameras.size(); ++i) {
    if (std::ranges::find(track->cameras, parts_.names.cameras[i]) == track->cameras.end())
      continue;
    estimate.cameras |= camera_bit(CameraId(static_cast<uint32_t>(i)));
  }
  if (followers_[object].take(estimate)) publish(estimate, FusionWorker::Cause::kFrame);
}

void CellCameras::advance(Time now) {
  if (leader_ && now - leader_heard_ > FusionClaim::kLapse) {
    log::warning({.cause = "cell"},
                 "cell: nothing is heard any more of host {}, which keeps the "
                 "estimates",
                 leader_->host);
    leader_.reset();
  }
  for (TrackFollower& follower : followers_) {
    if (const auto estimate = follower.advance(now)) {
      publish(*estimate, FusionWorker::Cause::kSilence);
    }
  }
}

void CellCameras::publish(const PoseEstimate& estimate, FusionWorker::Cause cause) {
  parts_.board->publish(estimate.object, followers_[estimate.object.index()].track());
  parts_.on_estimate(estimate, cause);
}

}  // namespace sightline
