// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/publish/mqtt.hpp"
#include "web/pose_feed.hpp"

namespace sightline {

struct MqttStatus {
  bool connected = false;
  std::string problem;  ///< why it is not; empty: it is, or is about to be
};

/// The thread ("mqtt") that publishes poses as they are estimated. A broker that is away, slow or
/// comes back costs nobody else anything.
class MqttWorker {
 public:
  /// Null without a broker in the options.
  static std::shared_ptr<MqttWorker> start(const MqttOptions& options,
                                           std::shared_ptr<PoseFeed> poses, Registry& registry,
                                           HeartbeatBoard& beats);
  ~MqttWorker() { (void)stop_unless_waiting(std::chrono::seconds(1)); }
  /// Says "offline". False: it waits for the broker, and the thread is left.
  bool stop_unless_waiting(Duration patience);
  MqttStatus status() const;
  const MqttOptions& options() const { return options_; }

 private:
  MqttWorker(const MqttOptions& options, std::shared_ptr<PoseFeed> poses,
             std::shared_ptr<HttpWaker> waker, Registry& registry);
  void run(const std::stop_token& stop, Heartbeat& heartbeat);
  /// Null where it cannot be made now.
  std::unique_ptr<MqttClient> make_client();
  void publish_new(MqttClient& client);
  void note(bool connected, const std::string& problem);

  const MqttOptions options_;
  const std::shared_ptr<PoseFeed> poses_;
  const std::shared_ptr<HttpWaker> waker_;
  Counter &published_, &dropped_;
  Gauge& connected_;
  std::unique_ptr<PoseFeed::Reader> reader_;  // while it is connected
  std::vector<PoseFeed::Entry> entries_;
  mutable std::mutex mutex_;  // guards status_
  MqttStatus status_;
  WatchedThread thread_;
};

}  // namespace sightline
