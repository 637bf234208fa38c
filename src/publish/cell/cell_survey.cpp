// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/cell_survey.hpp"

#include <algorithm>

#include "sightline/publish/cell/cell_bid.hpp"

namespace sightline {
namespace {

constexpr size_t kMost = 256;  // hosts, cameras, objects: whoever may write invents names

template <typename Entry>
Entry* entry(std::map<std::string, Entry>& map, const std::string& name) {
  if (map.size() >= kMost && !map.contains(name)) return nullptr;
  return &map[name];
}

}  // namespace

std::vector<MqttSession::Subscription> CellSurvey::subscriptions() const {
  std::vector<MqttSession::Subscription> all{{topics_.hosts(), 1},
                                             {topics_.fusion(), 1},
                                             {topics_.observations(), 0},
                                             {topics_.tracks(), 0}};
  for (const auto& [name, neighbor] : neighbors_) {
    const CellTopics topics(name);
    all.push_back({topics.fusion(), 1});
    all.push_back({topics.bids(), 0});
  }
  return all;
}

void CellSurvey::hear(std::string_view topic, std::string_view payload, int64_t now_utc_ns) {
  if (hear_neighbor(topic, payload)) return;
  if (topic == topics_.fusion()) return hear_claim(payload);
  if (topic.starts_with(topics_.cell + "/host/")) return hear_host(topic, payload);
  if (topic.starts_with(topics_.cell + "/track/")) {
    const auto track = decode_track(payload);
    Object* const object =
        track && topic == topics_.track(track->object) ? entry(objects_, track->object) : nullptr;
    if (object == nullptr) return void(++malformed_);
    ++object->tracks;
    object->state = track->estimate.state;
    object->cameras = track->cameras;
    return;
  }
  const auto observation = decode_observation(payload);
  Camera* const camera =
      observation && topic == topics_.observation(observation->camera, observation->object)
          ? entry(cameras_, observation->camera)
          : nullptr;
  if (camera == nullptr) return void(++malformed_);
  camera->host = observation->host;
  ++camera->observations;
  camera->oldest = std::max(camera->oldest, Duration(now_utc_ns - observation->capture_utc_ns));
}

void CellSurvey::hear_host(std::string_view topic, std::string_view payload) {
  const auto state = decode_host_state(payload);
  Host* const host =
      state && topic == topics_.host(state->host) ? entry(hosts_, state->host) : nullptr;
  if (host == nullptr) return void(++malformed_);
  host->state = *state;
  // The last will of a host that kept the estimates stands in its claim.
  if (claim_ && claim_->boot == state->boot && !claim_->online) host->state.online = false;
}

void CellSurvey::hear_bid(const CellTopics& topics, std::string_view topic,
                          std::string_view payload, Neighbor& neighbor) {
  const auto bid = decode_bid(payload);
  bool* const holds =
      bid && topic == topics.bid(bid->object) ? entry(neighbor.bids, bid->object) : nullptr;
  if (holds == nullptr) return void(++malformed_);
  *holds = bid->holds;
}

void CellSurvey::hear_claim_of(Neighbor& neighbor, std::string_view payload) {
  const auto claim = decode_host_state(payload);
  if (!claim) return void(++malformed_);
  const bool again = neighbor.boot == claim->boot && claim->beat > neighbor.beat;
  if (!claim->online) {
    neighbor.fusion.clear();
  } else if (again) {
    neighbor.fusion = claim->host;
  }
  neighbor.boot = claim->boot;
  neighbor.beat = claim->beat;
}

// False: the message is this cell's own.
bool CellSurvey::hear_neighbor(std::string_view topic, std::string_view payload) {
  for (auto& [name, neighbor] : neighbors_) {
    if (!topic.starts_with(name + "/")) continue;
    const CellTopics topics(name);
    if (topic == topics.fusion()) {
      hear_claim_of(neighbor, payload);
    } else {
      hear_bid(topics, topic, payload, neighbor);
    }
    return true;
  }
  return false;
}

// Once is not enough: brokers keep what the dead have said.
void CellSurvey::hear_claim(std::string_view payload) {
  const auto claim = decode_host_state(payload);
  if (!claim) return void(++malformed_);
  const bool again = claim_ && claim_->boot == claim->boot && claim_->online && claim->online &&
                     claim->beat > claim_->beat;
  claim_ = *claim;
  for (auto& [name, host] : hosts_) {
    if (again || name != claim->host) host.fuses = again && name == claim->host;
    if (host.state.boot == claim->boot) host.state.online = claim->online;
  }
  if (!claim->online) return;
  verdicts_ = claim->observations;
}

std::string CellSurvey::fusion() const {
  for (const auto& [name, host] : hosts_) {
    if (host.fuses && host.state.online) return name;
  }
  return {};
}

std::vector<std::string> CellSurvey::faults() const {
  std::vector<std::string> faults;
  if (hosts_.empty()) faults.emplace_back("no host has ever said anything at this broker");
  if (!hosts_.empty() && fusion().empty()) faults.emplace_back("no host keeps the estimates");
  for (const auto& [name, host] : hosts_) {
    if (!host.state.online) {
      faults.push_back(fmt::format("host {} is away", name));
      continue;
    }
    if (!host.state.clock_fit) {
      faults.push_back(fmt::format("host {}: its clock is not fit: {}", name, host.state.clock));
    }
    for (const CellHostState::Camera& camera : host.state.cameras) {
      if (camera.away) {
        faults.push_back(fmt::format("camera {} of host {} gives no frames", camera.name, name));
        continue;
      }
      if (host.fuses || cameras_.contains(camera.name)) continue;
      faults.push_back(fmt::format("camera {} of host {}: no observation while it was listened to",
                                   camera.name, name));
    }
  }
  for (const auto& [name, neighbor] : neighbors_) {
    if (!neighbor.fusion.empty()) continue;
    faults.push_back(fmt::format(
        "cell {} next to this one: nobody keeps its estimates, or the brokers do not bridge",
        name));
  }
  if (malformed_ > 0) {
    faults.push_back(
        fmt::format("{} messages that nobody can read, or at the topic of another", malformed_));
  }
  return faults;
}

}  // namespace sightline
