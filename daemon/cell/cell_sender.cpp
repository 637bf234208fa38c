// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_sender.hpp"

#include "sightline/publish/cell/frozen_observation.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

Counter& unsent(Registry& registry, const char* reason) {
  return registry.counter("sightline_cell_unsent_total", "Observations that were not sent",
                          {{"reason", reason}});
}

}  // namespace

CellSender::CellSender(const CellParts& parts, const CellIdentity& self, Registry& registry)
    : parts_(parts),
      self_(self),
      topics_(parts.options.name),
      doubted_(parts.names.objects.size()),
      sent_(registry.counter("sightline_cell_observations_sent_total",
                             "Observations that were sent")),
      late_(unsent(registry, "late")),
      no_clock_(unsent(registry, "clock")),
      no_broker_(unsent(registry, "broker")),
      overflow_(unsent(registry, "overflow")),
      no_pose_(unsent(registry, "no_pose")) {}

void CellSender::push(const Observation& observation) {
  const size_t object = observation.object.index();
  const size_t camera = observation.camera.index();
  if (object >= parts_.names.objects.size() || camera >= parts_.cameras.size()) return;
  std::vector<PoseTrackPtr> tracks;
  parts_.board->read(tracks);
  auto frozen = freeze(observation, tracks.at(object).get());
  if (!frozen) return no_pose_.add();
  Item item{*std::move(frozen), observation.object, observation.capture};
  item.observation.object = parts_.names.objects[object];
  item.observation.camera = parts_.cameras[camera].name;
  item.observation.calibration = parts_.cameras[camera].calibration;
  item.observation.host = self_.host;
  item.observation.boot = self_.boot;
  item.observation.doubted = doubted_[object];
  if (queue_.push(std::move(item))) overflow_.add();
}

void CellSender::send(MqttClient* client, const ClockWatch& clock, Time now,
                      const std::function<void(ObjectId)>& on_seen) {
  const ClockState state = clock.state(now);
  while (auto item = queue_.pop({}, 0ns)) {
    CellObservation& observation = item->observation;
    if (on_seen && !observation.at.empty()) on_seen(item->object);
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

}  // namespace sightline
