// SPDX-License-Identifier: Apache-2.0
#include "workers/mqtt_worker.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"
#include "web/pose_json.hpp"
#include "workers/wait_to_reopen.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 200ms;
constexpr Duration kStallLimit = 10s;  // besides what it waits for the broker
constexpr Duration kNextTry = 5s;      // to make a client, where a file of it is missing
constexpr size_t kMostAtOnce = 64;     // poses in one turn

// Names of objects may hold what separates topics, or stands for several.
std::string topic_of(const MqttOptions& options, std::string object) {
  for (char& c : object) {
    if (c == '/' || c == '+' || c == '#') c = '_';
  }
  return options.topic + "/objects/" + object;
}

}  // namespace

std::shared_ptr<MqttWorker> MqttWorker::start(const MqttOptions& options,
                                              std::shared_ptr<PoseFeed> poses, Registry& registry,
                                              HeartbeatBoard& beats) {
  if (options.host.empty()) return nullptr;
  auto waker = HttpWaker::create();
  if (!waker) {
    log::error("mqtt: {}", waker.error().message());
    return nullptr;
  }
  std::shared_ptr<MqttWorker> worker(
      new MqttWorker(options, std::move(poses), *std::move(waker), registry));
  worker->thread_ = WatchedThread(
      beats, "mqtt", kStallLimit,
      [raw = worker.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return worker;
}

MqttWorker::MqttWorker(const MqttOptions& options, std::shared_ptr<PoseFeed> poses,
                       std::shared_ptr<HttpWaker> waker, Registry& registry)
    : options_(options),
      poses_(std::move(poses)),
      waker_(std::move(waker)),
      published_(registry.counter("sightline_mqtt_published_total", "Poses that the broker got")),
      dropped_(
          registry.counter("sightline_mqtt_dropped_total", "Poses that a slow broker did not get")),
      connected_(registry.gauge("sightline_mqtt_connected", "1 while the broker is connected")) {}

bool MqttWorker::stop_unless_waiting(Duration patience) {
  thread_.request_stop();
  return !thread_.joinable() || thread_.join_unless_waiting(patience);
}

MqttStatus MqttWorker::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void MqttWorker::note(bool connected, const std::string& problem) {
  connected_.set(connected ? 1 : 0);
  const std::lock_guard lock(mutex_);
  if (connected && !status_.connected) {
    log::info("mqtt: connected to {}:{}", options_.host, options_.port);
  } else if (!connected && !problem.empty() && problem != status_.problem) {
    log::warning({.cause = "broker"}, "mqtt: {}:{}: {}; it is tried again", options_.host,
                 options_.port, problem);
  }
  // Between two attempts the last words stand, so that they are said once.
  status_ = {connected, connected ? "" : problem.empty() ? status_.problem : problem};
}

std::unique_ptr<MqttClient> MqttWorker::make_client() {
  auto made = MqttClient::create(options_);
  if (made) return *std::move(made);
  note(false, made.error().message());
  return nullptr;
}

void MqttWorker::run(const std::stop_token& stop, Heartbeat& heartbeat) {
  std::unique_ptr<MqttClient> client;
  Time next_try{};
  poses_->add_waker(waker_);
  while (!stop.stop_requested()) {
    heartbeat.beat();
    if (!client && MonotonicClock::now() >= next_try) {
      client = make_client();
      next_try = MonotonicClock::now() + kNextTry;
    }
    if (!client) {
      sleep_unless_stopped(stop, kTurn);
      continue;
    }
    client->step(kTurn, waker_->fd());
    waker_->clear();
    note(client->connected(), client->problem());
    if (!client->connected()) {
      reader_.reset();
    } else if (!reader_) {
      reader_ = std::make_unique<PoseFeed::Reader>(poses_);
    }
    if (reader_) publish_new(*client);
  }
  poses_->remove_waker(waker_);
  reader_.reset();
  client.reset();
  connected_.set(0);
}

void MqttWorker::publish_new(MqttClient& client) {
  entries_.clear();
  dropped_.add(reader_->read(entries_, kMostAtOnce));
  for (const PoseFeed::Entry& entry : entries_) {
    const size_t index = entry.estimate.object.index();
    if (index >= entry.names->objects.size()) continue;
    const bool sent = client.publish(topic_of(options_, entry.names->objects[index]),
                                     pose_event_json(entry.estimate, *entry.names), true);
    (sent ? published_ : dropped_).add();
  }
  if (reader_->ready()) waker_->wake();  // the rest
}

}  // namespace sightline
