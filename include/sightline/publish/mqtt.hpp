// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"

namespace sightline {

struct MqttOptions {
  std::string host;      ///< name or address of the broker; empty: nothing is published
  uint16_t port = 1883;  ///< 8883 is usual with `ca_file`
  /// Topics are TOPIC/objects/NAME (poses, the newest retained) and TOPIC/status ("online", or by
  /// the last will "offline", retained).
  std::string topic = "sightline";
  std::string client_id;                ///< empty: a random one
  std::string user;                     ///< empty: none
  std::filesystem::path password_file;  ///< its first line; needed with `user` only
  std::filesystem::path ca_file;        ///< PEM; with it the broker is spoken to over TLS
  /// PEM: who this client is, where the broker asks for it; both or neither, with `ca_file` only.
  std::filesystem::path certificate, key;

  bool operator==(const MqttOptions&) const = default;
};

/// What a client says of itself and listens to. Default: what MqttOptions::topic describes.
struct MqttSession {
  std::string will_topic, will;  ///< retained, QoS 1; said by the broker once the client is gone
  struct Subscription {
    std::string topic;
    int qos = 0;
  };
  std::vector<Subscription> subscriptions;  ///< asked for with every connection
  /// In step(): the connection stands and the subscriptions are asked for.
  std::function<void()> on_connect;
  /// In step(): a message; the views are of that call.
  std::function<void(std::string_view topic, std::string_view payload, bool retained)> on_message;
  int keep_alive_s = 15;                             ///< a broker that is silent for longer is gone
  Duration longest_wait = std::chrono::seconds(30);  ///< between attempts to connect
};

/// A client of one MQTT 3.1.1 broker that connects again for ever, 1 to 30 s apart. What cannot be
/// sent now is not kept: poses grow old. Passive: it works in the thread that calls step().
class MqttClient {
 public:
  /// Reads the password; connects later. kUnavailable where it was built without MQTT.
  static Result<std::unique_ptr<MqttClient>> create(const MqttOptions& options);
  /// The same for who speaks for itself: no status is said, and no topic is its own.
  static Result<std::unique_ptr<MqttClient>> create(const MqttOptions& options,
                                                    MqttSession session);
  virtual ~MqttClient() = default;  ///< says "offline" (the session's will) and disconnects

  /// Works until something was done, `timeout` has passed or `wake_fd` is readable (it is left so).
  /// Connecting may take as long as the name's lookup and the network; else it does not block.
  virtual void step(Duration timeout, int wake_fd) = 0;
  virtual bool connected() const = 0;
  /// Why it is not connected; empty while it is, or has not tried yet.
  virtual std::string problem() const = 0;
  /// False: it was not connected, or a slow broker has more waiting than kMostWaiting.
  virtual bool publish(const std::string& topic, const std::string& payload, bool retain,
                       int qos = 0) = 0;

  static constexpr size_t kMostWaiting = size_t{1} << 20;  ///< [bytes] that the socket did not take
};

/// Whether this program was built with MQTT.
bool mqtt_available();

}  // namespace sightline
